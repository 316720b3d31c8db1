"""One row an input: what it is, the command that meets it, and how that must end."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

BAD, USAGE, FINE, FAILED = 3, 2, 0, 1
"""Exit codes: bad input or environment, wrong usage, done, check failed."""
Make = Callable[[Path], list[str]]
"""Makes the input in a folder, which is the working folder of the command that it returns."""


@dataclass(frozen=True)
class Row:
    """An input.

    Attributes:
        what: it is, the name of the test.
        make: see `Make`.
        code: of the exit.
        words: that stdout or stderr must have; every one of them.
        replaced: files that the command may change, relative to the folder.
    """

    what: str
    make: Make
    code: int = BAD
    words: tuple[str, ...] = ()
    replaced: tuple[str, ...] = ()


def fifo(path: Path) -> None:
    """A fifo that nobody writes to."""
    os.mkfifo(path)


def endless(path: Path) -> None:
    """A link to a device without an end."""
    path.symlink_to("/dev/zero")


def dangling(path: Path) -> None:
    """A link to nothing."""
    path.symlink_to("nowhere")


def loop(path: Path) -> None:
    """A link to itself."""
    path.symlink_to(path.name)


def folder(path: Path) -> None:
    """A folder where a file should be."""
    path.mkdir()


def giant(path: Path) -> None:
    """A sparse file of 40 GB."""
    with path.open("wb") as file:
        file.truncate(40 << 30)


def empty(path: Path) -> None:
    """No byte."""
    path.touch()


def noise(path: Path) -> None:
    """Bytes that are no text and no format."""
    path.write_bytes(bytes((37 * place + place // 7) % 256 for place in range(3000)))


def nothing(path: Path) -> None:
    """No file."""


INSTEAD: dict[str, Callable[[Path], None]] = {
    "missing": nothing,
    "fifo": fifo,
    "device": endless,
    "dangling link": dangling,
    "link to itself": loop,
    "folder": folder,
    "40 GB": giant,
    "empty": empty,
    "noise": noise,
}
"""What may stand where a file is expected."""


def instead_of(what: str, build: Callable[[Path], list[str]], place: str, *but: str) -> Iterator[Row]:
    """A row for everything that may stand in the place of one file.

    Args:
        what: the file is.
        build: makes everything else.
        place: of the file in the folder.
        but: kinds that are no error there.
    """

    def make(put: Callable[[Path], None]) -> Make:
        def made(root: Path) -> list[str]:
            command = build(root)
            path = root / place
            path.unlink()
            put(path)
            return command

        return made

    for kind, put in INSTEAD.items():
        if kind not in but:
            yield Row(f"{what}: {kind}", make(put), BAD, (Path(place).name,))
