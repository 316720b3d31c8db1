"""Opens all files that a user names: only regular files of plausible size, and never one that blocks.

A path may name a fifo without a writer, an endless device, or a sparse file of 40 GB. Files opened here are known to
`calibnet.runtime.writing`, which never replaces what the same run reads.
"""

from __future__ import annotations

import json
import os
import stat
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO, NoReturn, TypeVar

import yaml

from calibnet.errors import CalibnetError, DatasetError

MEGABYTE = 1 << 20
TEXT_BYTES, MOST_LINES = 16 * MEGABYTE, 1_000_000
"""Largest size of a list of times or frames; that of a calibration, manifest or preset is `SETTINGS_BYTES`."""
SETTINGS_BYTES = MEGABYTE // 4
LFS_POINTER = b"version https://git-lfs.github.com/spec/"
"""First bytes of a pointer file that Git LFS left in place of the real one."""
DEEPEST = 24
"""Largest depth of nesting in YAML and JSON; real files have four levels."""

Identity = tuple[int, int]
"""Device and inode, which are the same for two paths to one file."""
Version = tuple[int, int]
"""Size, and time of the last change."""
Loaded = TypeVar("Loaded")

_inputs: set[Identity] | None = None
"""Files that the run reads; None outside of `protecting_inputs`."""
_versions: dict[Path, Version] = {}
"""Files that it will read more than once, as they were when it began."""


class TooLargeError(OSError):
    """A file is larger than anything of its kind."""


@contextmanager
def protecting_inputs() -> Iterator[None]:
    """A context that remembers which files are read, so that none of them is replaced (`is_input`) or changes."""
    global _inputs, _versions
    before, _inputs, _versions = (_inputs, _versions), set(), {}
    try:
        yield
    finally:
        _inputs, _versions = before


def register_input(path: Path) -> None:
    """Remember a file that will be read later, perhaps several times; a missing one is ignored.

    It is refused once it has changed, since a result from both of its versions would be one of neither.
    """
    if _inputs is not None:
        try:
            status = path.stat()
        except OSError:
            return
        _inputs.add(_identity(status))
        _versions[path] = _version(status)


def is_input(status: os.stat_result) -> bool:
    """Whether the run reads the file of this status."""
    return _inputs is not None and _identity(status) in _inputs


def open_file(path: Path, largest: int | None = None, remember: bool = True) -> BinaryIO:
    """Open a regular file for reading; anything else raises an error at once.

    Args:
        path: the file; links are followed.
        largest: largest plausible size in bytes.
        remember: whether it is an input of the run.

    Raises:
        OSError: it is missing, cannot be read, is not a regular file, is too large (`TooLargeError`), or has changed
            since `register_input`.
    """
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC | getattr(os, "O_NONBLOCK", 0))
    except ValueError as error:  # a name with a null character
        raise OSError(0, str(error), str(path)) from None
    try:
        status = os.fstat(descriptor)
        if not stat.S_ISREG(status.st_mode):
            raise OSError(0, f"it is {kind_of(status.st_mode)}, not a file", str(path))
        if largest is not None and status.st_size > largest:
            raise TooLargeError(0, _too_large(status.st_size, largest), str(path))
        if remember and _versions.get(path, _version(status)) != _version(status):
            raise OSError(0, "it has changed since this run began", str(path))
    except BaseException:
        os.close(descriptor)
        raise
    if remember and _inputs is not None:
        _inputs.add(_identity(status))
    return os.fdopen(descriptor, "rb")


def require_file(path: Path, what: str, largest: int | None, error: type[CalibnetError], remedy: str) -> None:
    """Check a file that a library will open by its name.

    Raises:
        CalibnetError: of type ``error``; the file cannot be read, is not a regular file, or is too large.
    """
    try:
        open_file(path, largest).close()
    except OSError as problem:
        _refuse(path, what, problem, error, remedy)


def read_file(
    path: Path, what: str, largest: int, error: type[CalibnetError] = DatasetError, remedy: str = "restore it"
) -> bytes:
    """All bytes of a file.

    Args:
        path: the file.
        what: kind of file, the first words of the message, for instance ``"Scan"``.
        largest: largest plausible size in bytes.
        error: type of the error to raise.
        remedy: end of the message, on what to do about it.

    Raises:
        CalibnetError: of type ``error``; the file cannot be read, is not a regular file, or is too large.
    """
    try:
        with open_file(path, largest) as file:
            size = os.fstat(file.fileno()).st_size
            data = file.read(size + 1)  # not `largest`, which would be allocated at once
            if len(data) > size:
                data += file.read(max(0, largest + 1 - len(data)))
        if len(data) > largest:  # it has grown in the meantime
            raise TooLargeError(0, _too_large(len(data), largest), str(path))
        if data.startswith(LFS_POINTER):
            raise OSError(0, "Git LFS left a pointer in its place; fetch it with 'git lfs pull'", str(path))
    except OSError as problem:
        _refuse(path, what, problem, error, remedy)
    return data


def read_text(
    path: Path,
    what: str,
    largest: int = SETTINGS_BYTES,
    error: type[CalibnetError] = DatasetError,
    remedy: str = "restore it",
) -> str:
    """A file as UTF-8 text without a byte-order mark; arguments and errors are those of `read_file`."""
    data = read_file(path, what, largest, error, remedy)
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise error(f"{what} {path} cannot be read (it is not a text file in UTF-8); {remedy}.") from None


def read_lines(path: Path, what: str, remedy: str = "restore it") -> list[str]:
    """The lines of a list of times or frames; arguments and errors are those of `read_file`.

    They are counted before they are split, since 16 MB may be as many lines.
    """
    text = read_text(path, what, TEXT_BYTES, DatasetError, remedy)
    if text.count("\n") > MOST_LINES:
        raise DatasetError(f"{what} {path} has more than {MOST_LINES:,} lines; {remedy}.")
    return text.splitlines()


def parse_yaml(text: str) -> Any:
    """Parse YAML without what settings do not need: aliases, dates, duplicate keys, and more levels than `DEEPEST`.

    Raises:
        ValueError: it is not such YAML; the message says why in a few words, and where if known.
    """
    try:
        return yaml.load(text, _PlainLoader)
    except yaml.MarkedYAMLError as problem:
        line = f", line {problem.problem_mark.line + 1}" if problem.problem_mark is not None else ""
        raise ValueError(f"{problem.problem or problem.context or 'malformed'}{line}") from None
    except Exception as problem:  # tags are converted by Python, with Python's errors
        raise ValueError(f"a value cannot be read ({type(problem).__name__})") from None


def parse_json(text: str | bytes) -> Any:
    """Parse strict JSON, without NaN, infinity and duplicate keys.

    Raises:
        ValueError: it is none, or nested too deeply.
    """
    try:
        return json.loads(text, parse_constant=_no_number, object_pairs_hook=_distinct)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None


def parse_toml(text: str) -> dict[str, Any]:
    """Parse TOML.

    Raises:
        ValueError: it is none, or nested too deeply.
    """
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None


def kind_of(mode: int) -> str:
    """The kind of a file, in words."""
    kinds = {
        stat.S_IFDIR: "a folder",
        stat.S_IFIFO: "a fifo",
        stat.S_IFCHR: "a device",
        stat.S_IFBLK: "a device",
        stat.S_IFSOCK: "a socket",
        stat.S_IFLNK: "a link",
    }
    return kinds.get(stat.S_IFMT(mode), "something else")


class _PlainLoader(yaml.SafeLoader):
    """The loader of `parse_yaml`."""

    def __init__(self, stream: str) -> None:
        super().__init__(stream)
        self._level = 0
        unwanted = ("tag:yaml.org,2002:timestamp", "tag:yaml.org,2002:merge")
        self.yaml_implicit_resolvers = {
            first: [(tag, pattern) for tag, pattern in resolvers if tag not in unwanted]
            for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
        }

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        if self.check_event(yaml.AliasEvent):
            event = self.peek_event()  # type: ignore[no-untyped-call]
            raise yaml.constructor.ConstructorError(None, None, "aliases are not read", event.start_mark)
        self._level += 1
        if self._level > DEEPEST:
            event = self.peek_event()  # type: ignore[no-untyped-call]
            raise yaml.constructor.ConstructorError(None, None, "nested too deeply", event.start_mark)
        node = super().compose_node(parent, index)
        self._level -= 1
        return node

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        seen: set[str] = set()
        for key, _ in node.value:
            if isinstance(key, yaml.ScalarNode):
                if key.value in seen:
                    problem = f"the key {key.value[:40]!r} is given twice"
                    raise yaml.constructor.ConstructorError(None, None, problem, key.start_mark)
                seen.add(key.value)
        return super().construct_mapping(node, deep)


def _no_number(text: str) -> NoReturn:
    raise ValueError(f"{text} is not a number")


def _distinct(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    content = dict(pairs)
    if len(content) < len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"the key {twice[:40]!r} is given twice")
    return content


def _identity(status: os.stat_result) -> Identity:
    return status.st_dev, status.st_ino


def _version(status: os.stat_result) -> Version:
    return status.st_size, status.st_mtime_ns  # some network file systems number files anew


def _too_large(size: int, largest: int) -> str:
    return f"it has {size / 1e6:.0f} MB, more than the {largest / 1e6:.0f} MB that such a file can have"


def _refuse(path: Path, what: str, problem: OSError, error: type[CalibnetError], remedy: str) -> NoReturn:
    raise error(f"{what} {path} cannot be read ({problem.strerror or problem}); {remedy}.") from None
