"""A file is complete or what it was before."""

from __future__ import annotations

import errno
import os
import resource
import stat
from pathlib import Path

import numpy as np
import pytest
from safetensors.numpy import save_file

from calibnet.runtime.reading import protecting_inputs, read_file
from calibnet.runtime.writing import (
    Kind,
    OutputError,
    allow_overwriting,
    check_output,
    keeping_others,
    kind_of_content,
    write_whole,
)


def test_the_file_and_its_folder_are_made(tmp_path: Path) -> None:
    file = tmp_path / "new" / "folder" / "out.json"
    write_whole(file, b"{}")
    assert file.read_bytes() == b"{}"
    write_whole(file, lambda partial: partial.write_text("[]"))
    assert file.read_text() == "[]"
    assert list(file.parent.iterdir()) == [file]


@pytest.mark.parametrize("error", [OSError(errno.ENOSPC, "No space left on device"), ValueError("a bug")])
def test_what_fails_half_way_leaves_what_was_there(tmp_path: Path, error: Exception) -> None:
    file = tmp_path / "out.json"
    file.write_text("before")

    def write(partial: Path) -> None:
        partial.write_text("hal")
        raise error

    with pytest.raises(type(error), match=str(error.args[-1])):
        write_whole(file, write)
    assert file.read_text() == "before"
    assert list(tmp_path.iterdir()) == [file]


def test_a_library_in_rust_that_finds_no_room_is_an_error_of_the_system(tmp_path: Path) -> None:
    out = tmp_path / "out.safetensors"
    out.write_bytes(b"before")
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1 << 16, hard))
    try:
        with pytest.raises(OSError, match=r"out\.safetensors") as caught:
            write_whole(out, lambda partial: save_file({"a": np.zeros(1 << 16)}, partial))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert caught.value.errno == errno.EFBIG
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [b"before"]


def test_the_error_names_the_file_that_was_asked_for(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OSError, match="file") as caught:
        write_whole(tmp_path / "file" / "out.json", b"")
    assert caught.value.filename == str(tmp_path / "file" / "out.json")
    assert caught.value.errno in (errno.ENOTDIR, errno.EEXIST)


CONTENTS = {
    Kind.RECORDING: b"RRF2\0",
    Kind.JSON: b'\n{"a": 1}',
    Kind.JUNIT: b"<?xml version='1.0'?>\n<testsuites/>",
    Kind.EXPORT: b"P0: 1 0 0\n# source: calib-inspect, a run\n",
    Kind.PAGE: b'<!doctype html><meta name="generator" content="calib-inspect">',
    Kind.PNG: b"\x89PNG\r\n",
    Kind.JPEG: b"\xff\xd8\xff\xe0",
    Kind.GIF: b"GIF89a",
    Kind.WEBP: b"RIFF\1\0\0\0WEBP",
    Kind.WEIGHTS: b'\x10\0\0\0\0\0\0\0{"__metadata__"',
    Kind.TABLE: b"method,range,rig,in_rig\n",
    Kind.PARQUET: b"PAR1\x15\x04",
    Kind.OTHER: b"width: 640",
    Kind.EMPTY: b"",
}


@pytest.mark.parametrize("kind", list(Kind))
def test_files_are_told_by_how_they_begin(kind: Kind) -> None:
    assert kind_of_content(CONTENTS[kind]) is kind


@pytest.mark.parametrize("found", [kind for kind in Kind if kind is not Kind.EMPTY])
@pytest.mark.parametrize("kind", [Kind.RECORDING, Kind.JSON, Kind.EXPORT])
def test_only_the_same_kind_is_replaced_unless_asked(tmp_path: Path, found: Kind, kind: Kind) -> None:
    file = tmp_path / "file"
    file.write_bytes(CONTENTS[found])
    if found is kind:
        assert write_whole(file, CONTENTS[kind], kind), "says that it replaced a file"
        return
    with pytest.raises(OutputError, match="add --overwrite"):
        write_whole(file, CONTENTS[kind], kind)
    assert file.read_bytes() == CONTENTS[found]
    with keeping_others():
        allow_overwriting()
        assert write_whole(file, CONTENTS[kind], kind)
    assert file.read_bytes() == CONTENTS[kind]
    assert list(tmp_path.iterdir()) == [file]


def test_an_empty_file_and_a_new_name_are_no_replacement(tmp_path: Path) -> None:
    assert not write_whole(tmp_path / "new", b"{}", Kind.JSON)
    (tmp_path / "empty").touch()
    assert not write_whole(tmp_path / "empty", b"{}", Kind.JSON)


def test_what_the_run_reads_is_never_replaced(tmp_path: Path) -> None:
    file, hard = tmp_path / "in.json", tmp_path / "out.json"
    file.write_text("{}")
    os.link(file, hard)
    with protecting_inputs(), keeping_others():
        allow_overwriting()
        read_file(file, "JSON", 100)
        for path in (file, hard):
            with pytest.raises(OutputError, match="is an input of this run"):
                write_whole(path, b"{}", Kind.JSON)


def test_links_devices_and_fifos_are_not_written_to(tmp_path: Path) -> None:
    target = tmp_path / "target.json"
    target.write_text("{}")
    (tmp_path / "link").symlink_to(target)
    (tmp_path / "dangling").symlink_to("nowhere")
    os.mkfifo(tmp_path / "fifo")
    with keeping_others():
        allow_overwriting()
        for path, words in (
            (tmp_path / "link", "is a link, not a file; give the file itself"),
            (tmp_path / "dangling", "is a link, not a file"),
            (tmp_path / "fifo", "is a fifo, not a file"),
            (Path("/dev/null"), "is a device, not a file"),
            (tmp_path, "is a folder, not a file"),
        ):
            for kind in (Kind.JSON, None):
                with pytest.raises(OutputError, match=words):
                    check_output(path, kind)
    assert stat.S_ISFIFO((tmp_path / "fifo").stat().st_mode)


def test_partial_files_follow_no_link_that_is_laid_before_them(tmp_path: Path) -> None:
    victim = tmp_path / "victim"
    victim.write_text("kept")
    for name in ("out.json.partial", f"out.json.{os.getpid()}.partial"):
        (tmp_path / name).symlink_to(victim)
    write_whole(tmp_path / "out.json", b"{}", Kind.JSON)
    assert victim.read_text() == "kept"


def test_results_have_the_permissions_of_any_file(tmp_path: Path) -> None:
    (tmp_path / "plain").touch()
    write_whole(tmp_path / "out.json", b"{}", Kind.JSON)
    assert (tmp_path / "out.json").stat().st_mode == (tmp_path / "plain").stat().st_mode


def test_the_permissions_of_other_threads_files_stay_as_they_are(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The mask is the whole process's: a file that a thread made while it was 0 could be written by anybody."""
    monkeypatch.setattr(os, "umask", lambda mask: pytest.fail("the mask was changed"))
    write_whole(tmp_path / "out.json", b"{}", Kind.JSON)
