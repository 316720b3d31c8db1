"""Opening what a user gives: regular files of a size that can be meant."""

from __future__ import annotations

import os
import socket
from pathlib import Path

import pytest

from calibnet.errors import DatasetError
from calibnet.runtime.reading import (
    is_input,
    parse_json,
    parse_toml,
    parse_yaml,
    protecting_inputs,
    read_file,
    read_text,
    register_input,
)


def refused(path: Path, largest: int = 100) -> str:
    with pytest.raises(DatasetError) as caught:
        read_file(path, "Scan", largest)
    assert str(path) in str(caught.value)
    assert str(caught.value).endswith("; restore it.")
    return str(caught.value)


def test_a_file_is_read_whole_through_a_link(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"data")
    (tmp_path / "link").symlink_to("file")
    assert read_file(tmp_path / "link", "Scan", 4) == b"data"


def test_nothing_but_regular_files_is_opened_and_nothing_is_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "fifo")
    assert "a fifo" in refused(tmp_path / "fifo")
    (tmp_path / "zero").symlink_to("/dev/zero")
    assert "a device" in refused(tmp_path / "zero")
    assert "a folder" in refused(tmp_path)
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(tmp_path / "s"))
        refused(tmp_path / "s")
    assert "No such file" in refused(tmp_path / "gone")
    (tmp_path / "loop").symlink_to("loop")
    refused(tmp_path / "loop")


def test_a_sparse_giant_is_refused_before_it_is_read(tmp_path: Path) -> None:
    with (tmp_path / "giant").open("wb") as file:
        file.truncate(40 << 30)
    assert "42950 MB" in refused(tmp_path / "giant", 100 << 20)
    assert "105 MB" in refused(tmp_path / "giant", 100 << 20)


def test_text_is_utf_8(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"\xef\xbb\xbfwidth: 3")
    assert read_text(tmp_path / "file", "Calibration") == "width: 3"
    (tmp_path / "file").write_bytes("größe".encode("latin-1"))
    with pytest.raises(DatasetError, match="not a text file in UTF-8"):
        read_text(tmp_path / "file", "Calibration")


def test_yaml_is_read_as_what_stands_there() -> None:
    text = "width: 640\nmatrix: [[1.5, 0], [0.5e-3, 2]]\nday: 2011-09-26\nnested: {a: {b: [~, true, x]}}"
    assert parse_yaml(text) == {
        "width": 640,
        "matrix": [[1.5, 0], [0.0005, 2]],
        "day": "2011-09-26",
        "nested": {"a": {"b": [None, True, "x"]}},
    }


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("a: &x [1]\nb: *x", "aliases are not read, line 2"),
        ("a: 1\na: 2", "the key 'a' is given twice, line 2"),
        ("[" * 3000 + "]" * 3000, "nested too deeply"),
        ("a: {" * 30 + "}" * 30, "nested too deeply"),
        ("a: !!int abc", "a value cannot be read"),
        ("a: !!timestamp 99", "a value cannot be read"),
        ("a: !!float x", "a value cannot be read"),
        ("a: " + "9" * 5000, "a value cannot be read"),
        ("a: !!python/object/apply:os.system [ls]", "could not determine a constructor"),
        ("a: [1, 2", "line 1"),
        ("a: \x01", "cannot be"),
        ("? [a]\n: 1", "unhashable"),
    ],
)
def test_yaml_that_is_none_or_a_bomb_says_why(text: str, why: str) -> None:
    with pytest.raises(ValueError, match=why.replace("'", ".")):
        parse_yaml(text)


def test_json_and_toml_are_strict_and_bounded() -> None:
    assert parse_json(b'{"a": [1]}') == {"a": [1]}
    assert parse_toml("a = 1") == {"a": 1}
    for text in ("[" * 100_000, '{"a": NaN}', '{"a": Infinity}', "9" * 5000, "", b"\xff"):
        with pytest.raises(ValueError):
            parse_json(text)
    for text in ("a = " + "[" * 10_000, "a = 1\na = 2", "a"):
        with pytest.raises(ValueError):
            parse_toml(text)


def test_inputs_are_known_by_identity_within_a_run(tmp_path: Path) -> None:
    file, later, other = tmp_path / "file", tmp_path / "later", tmp_path / "other"
    for path in (file, later, other):
        path.write_text("x")
    os.link(file, tmp_path / "same")
    with protecting_inputs():
        read_file(file, "Scan", 10)
        register_input(later)
        register_input(tmp_path / "gone")
        assert is_input((tmp_path / "same").stat())
        assert is_input(later.stat())
        assert not is_input(other.stat())
    assert not is_input(file.stat())


def test_what_git_lfs_left_is_called_so(tmp_path: Path) -> None:
    file = tmp_path / "0000.bin"
    file.write_bytes(b"version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 12\n")
    with pytest.raises(DatasetError, match=r"0000\.bin cannot be read \(Git LFS left a pointer .* 'git lfs pull'\)"):
        read_file(file, "Scan", 1000)


@pytest.mark.parametrize("change", ["longer", "another"])
def test_a_file_that_is_read_again_must_not_have_changed(tmp_path: Path, change: str) -> None:
    image = tmp_path / "0000.png"
    image.write_bytes(b"first")
    with protecting_inputs():
        register_input(image)
        assert read_file(image, "Image", 100) == b"first"
        image.write_bytes({"longer": b"first and more", "another": b"other"}[change])
        os.utime(image, ns=(0, 10**18))
        with pytest.raises(
            DatasetError, match=r"Image .*0000\.png cannot be read \(it has changed since this run began"
        ):
            read_file(image, "Image", 100)
    with protecting_inputs():
        read_file(image, "Image", 100)
