"""Writing a file whole or not at all: a full disk leaves what was there before."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path


def write_whole(path: Path, write: bytes | Callable[[Path], object]) -> None:
    """Write beside ``path`` and move into place.

    Args:
        path: the file; what it held stays until the new content is complete.
        write: the content, or what writes it to the path it is given.

    Raises:
        OSError: it cannot be written; nothing is left behind.
    """
    partial = path.with_name(f"{path.name}.partial")
    try:
        if isinstance(write, bytes):
            partial.write_bytes(write)
        else:
            write(partial)
        partial.replace(path)
    except OSError as error:
        partial.unlink(missing_ok=True)
        raise OSError(error.errno, error.strerror or str(error), str(path)) from None
