"""Writing a file whole or not at all: a full disk leaves what was there before."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable
from pathlib import Path


def write_whole(path: Path, write: bytes | Callable[[Path], object]) -> None:
    """Write beside ``path`` and move into place; several processes may write the same file.

    Args:
        path: the file; what it held stays until the new content is complete. Its folder is created if need be.
        write: the content, or what writes it to the path it is given.

    Raises:
        OSError: it cannot be written; nothing is left behind.
    """
    partial = path.with_name(f"{path.name}.{os.getpid()}.partial")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        if isinstance(write, bytes):
            partial.write_bytes(write)
        else:
            write(partial)
        partial.replace(path)
    except BaseException as error:
        with contextlib.suppress(OSError):
            partial.unlink()
        if isinstance(error, OSError):
            raise OSError(error.errno, error.strerror or str(error), str(path)) from None
        raise
