"""Writes all output files, whole or not at all, and never over files that must not be lost.

An output is a new file or replaces a regular file of the same kind: not a device, fifo or link, not an input of the
same run (`calibnet.runtime.reading`) and, without ``--overwrite``, not a file of another kind.
"""

from __future__ import annotations

import contextlib
import glob
import hashlib
import os
import re
import secrets
import stat
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path

from calibnet.errors import ConfigError
from calibnet.runtime.reading import is_input, kind_of, open_file

HEAD_BYTES = 1 << 20
"""Number of bytes of an existing file that are read to find its kind."""


class OutputError(ConfigError):
    """An output that must not or cannot be written."""


class Kind(StrEnum):
    """Kinds of files, in words."""

    RECORDING = "a recording"
    JSON = "a JSON file"
    JUNIT = "a JUnit file"
    EXPORT = "a file that calib-inspect exported"
    PAGE = "the page of a report"
    TABLE = "a CSV table of calib-inspect"
    PNG = "a PNG picture"
    JPEG = "a JPEG picture"
    GIF = "a GIF picture"
    WEBP = "a WebP picture"
    WEIGHTS = "a safetensors file"
    PARQUET = "a Parquet table"
    EMPTY = "empty"
    OTHER = "something else"


_overwriting = False


@contextmanager
def keeping_others() -> Iterator[None]:
    """A context in which files of another kind are not replaced, unless `allow_overwriting` is called."""
    global _overwriting
    before, _overwriting = _overwriting, False
    try:
        yield
    finally:
        _overwriting = before


PARTIAL, LONGEST_NAME = ".partial", 100
"""Suffix of partial files, and the largest part of an output's name that our files beside it use."""


def allow_overwriting() -> None:
    """Let outputs replace files of any kind, but not inputs, links or devices."""
    global _overwriting
    _overwriting = True


def check_output(path: Path, kind: Kind | None) -> bool:
    """Check, before the work and again before writing, whether an output may be written.

    Args:
        path: the file.
        kind: kind of the output; None for a file of our own bookkeeping, which is read and replaced.

    Returns:
        Whether an existing file will be replaced.

    Raises:
        OutputError: it must not be written.
    """
    try:
        status = path.lstat()
    except (FileNotFoundError, NotADirectoryError):
        return False
    except OSError as error:
        raise OutputError(f"{path} cannot be written ({error.strerror}); choose another path.") from None
    if not stat.S_ISREG(status.st_mode):
        advice = "give the file itself" if stat.S_ISLNK(status.st_mode) else "give a new name or a file to replace"
        raise OutputError(f"{path} is {kind_of(status.st_mode)}, not a file; {advice}.")
    if kind is None:
        return True
    if is_input(status):
        raise OutputError(f"{path} is an input of this run; choose another path for the output.")
    found = kind_of_file(path)
    if found not in (kind, Kind.EMPTY) and not _overwriting:
        raise OutputError(f"{path} is not {kind} but {found}; choose another path, or add --overwrite to replace it.")
    return found is not Kind.EMPTY


def write_whole(path: Path, write: bytes | Callable[[Path], object], kind: Kind | None = None) -> bool:
    """Write to a partial file beside ``path`` and move it into place; several processes may write the same file.

    Args:
        path: the file, which is kept until the new content is complete; its folder is created if missing.
        write: the content, or a function that writes it to a given path.
        kind: see `check_output`.

    Returns:
        Whether a file was replaced.

    Raises:
        OutputError: the file must not be replaced.
        OSError: it cannot be written; nothing is left behind.
    """
    partial: Path | None = None
    with naming(path):
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            check_output(path, kind)
            partial, mode = _begin(path)
            if isinstance(write, bytes):
                partial.write_bytes(write)
            else:
                write(partial)
            partial.chmod(mode)  # safetensors makes a file of its own there, and keeps it to its owner
            _settle(partial)
            replaced = check_output(path, kind)
            partial.replace(path)
        except BaseException:
            if partial is not None:
                with contextlib.suppress(OSError):
                    partial.unlink()
            raise
    return replaced


@contextmanager
def naming(path: Path) -> Iterator[None]:
    """A context in which an error of the operating system is an `OSError` that names an output, whoever raises it."""
    try:
        yield
    except Exception as error:
        told = re.search(r"\(os error (\d+)\)", str(error))  # libraries in Rust have errors of their own for all
        if told:
            raise OSError(int(told[1]), os.strerror(int(told[1])), str(path)) from None
        if isinstance(error, OSError):
            raise OSError(error.errno, error.strerror or str(error), str(path)) from None
        raise


def _begin(path: Path) -> tuple[Path, int]:
    """An empty file of a new name beside ``path``, with the usual permissions of a new file."""
    while True:
        partial = path.with_name(f"{hidden(path)}{secrets.token_hex(4)}{PARTIAL}")
        with contextlib.suppress(FileExistsError):
            descriptor = os.open(partial, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
            try:
                return partial, stat.S_IMODE(os.fstat(descriptor).st_mode)
            finally:
                os.close(descriptor)


def remove_partials(path: Path) -> None:
    """Remove partial files that a killed `write_whole` left beside ``path``; the caller must have its lock."""
    for left in path.parent.glob(f"{glob.escape(hidden(path))}{'[a-z0-9_]' * 8}{PARTIAL}"):
        with contextlib.suppress(OSError):
            left.unlink()


def hidden(path: Path) -> str:
    """Start of the names of our own files beside an output, which are hidden and never too long."""
    name = path.name if len(path.name) <= LONGEST_NAME else hashlib.sha256(os.fsencode(path.name)).hexdigest()
    return f".{name}."


def _settle(path: Path) -> None:
    """Flush a file to the disk, so that a power cut after it replaced another one does not lose both."""
    descriptor = os.open(path, os.O_RDWR)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def kind_of_content(head: bytes) -> Kind:
    """The kind of a file, by its first bytes."""
    if not head:
        return Kind.EMPTY
    for start, kind in _STARTS.items():
        if head.startswith(start):
            return kind
    if head[:4] == b"RIFF" and head[8:12] == b"WEBP":
        return Kind.WEBP
    text = head.lstrip()
    if text.startswith((b"<?xml", b"<testsuite")) and b"<testsuite" in head:
        return Kind.JUNIT
    if text[:9].lower() == b"<!doctype" and b'content="calib-inspect"' in head:
        return Kind.PAGE
    if text.startswith(b"method,range,rig"):
        return Kind.TABLE
    if head[7:9] == b"\0{":
        return Kind.WEIGHTS
    if text.startswith((b"{", b"[")):
        return Kind.JSON
    return Kind.EXPORT if b"calib-inspect" in head else Kind.OTHER


_STARTS = {
    b"RRF": Kind.RECORDING,
    b"\x89PNG": Kind.PNG,
    b"\xff\xd8\xff": Kind.JPEG,
    b"GIF8": Kind.GIF,
    b"PAR1": Kind.PARQUET,
}


def kind_of_file(path: Path) -> Kind:
    """The kind of a file; a file that cannot be read is of another kind."""
    try:
        with open_file(path, remember=False) as file:
            return kind_of_content(file.read(HEAD_BYTES))
    except OSError:
        return Kind.OTHER  # it may not be ours
