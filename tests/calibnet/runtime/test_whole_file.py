"""A file is complete or what it was before."""

from __future__ import annotations

import errno
from pathlib import Path

import pytest

from calibnet.runtime.whole_file import write_whole


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


def test_the_error_names_the_file_that_was_asked_for(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OSError, match="file") as caught:
        write_whole(tmp_path / "file" / "out.json", b"")
    assert caught.value.filename == str(tmp_path / "file" / "out.json")
    assert caught.value.errno in (errno.ENOTDIR, errno.EEXIST)
