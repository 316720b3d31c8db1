"""Bounds the unpacking of bags, so that a small file cannot take all memory or all of a disk."""

from __future__ import annotations

import os
import shutil
import tempfile
from bz2 import BZ2Decompressor
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

LARGEST_BYTES = 512 << 20
"""Largest unpacked chunk or message; recorders start a new chunk after a few megabytes."""
STEP_BYTES = 16 << 20
MOST_TIMES = 100
"""Largest factor by which a packed file may grow, beyond `LARGEST_BYTES`; images and scans shrink to about a third."""
RESERVE_BYTES = 1 << 30
"""Disk space to leave free for temporary files, to which whole bags are unpacked."""


def bound_unpacking() -> None:
    """Limit the size of all chunks and files that rosbags and mcap unpack from now on."""
    import mcap.stream_reader
    from lz4.frame import LZ4FrameDecompressor  # type: ignore[import-untyped]
    from rosbags.rosbag1.reader import decompressors
    from rosbags.rosbag2 import reader
    from rosbags.rosbag2.storage_mcap import DECOMPRESSORS

    zstd: Any = vars(reader)["zstd"]
    lz4, zstd.decompress = bounded(LZ4FrameDecompressor), bounded(zstd.ZstdDecompressor)
    zstd.open = bounded_file(zstd.ZstdFile)
    decompressors.update(bz2=bounded(BZ2Decompressor), lz4=lz4)
    foreign: Any = vars(mcap.stream_reader)
    foreign["lz4"] = SimpleNamespace(decompress=lz4)
    foreign["zstandard"] = SimpleNamespace(decompress=lambda data, _: zstd.decompress(data))
    DECOMPRESSORS.update(lz4=lambda data, _: lz4(data), zstd=lambda data, _: zstd.decompress(data))


def bounded(make: Callable[[], Any]) -> Callable[[bytes], bytes]:
    """A function that unpacks one chunk within the bound.

    Args:
        make: makes a decompressor with the interface of Python's own.
    """

    def unpack(data: bytes) -> bytes:
        unpacker = make()
        pieces = [unpacker.decompress(data, STEP_BYTES)]
        size = len(pieces[0])
        while not (unpacker.eof or unpacker.needs_input):
            pieces.append(unpacker.decompress(b"", STEP_BYTES))
            size += len(pieces[-1])
            if size > LARGEST_BYTES:
                raise ValueError(f"a chunk unpacks to more than {LARGEST_BYTES >> 20} MB")
        if not unpacker.eof:
            raise ValueError("a packed chunk is truncated")
        return b"".join(pieces)

    return unpack


def bounded_file(kind: Any) -> type[Any]:
    """A class of packed files that are read up to a bound, which is a plausible size and the space on the disk.

    Args:
        kind: class of packed files.
    """

    class BoundedFile(kind):  # type: ignore[misc]  # rosbags brings its zstd without types
        """Counts the bytes that are read."""

        def __init__(self, file: Any, mode: str = "rb", **options: Any) -> None:
            super().__init__(file, mode, **options)
            self._left = 0
            if "r" in mode:
                room = shutil.disk_usage(tempfile.gettempdir()).free - RESERVE_BYTES
                self._most = max(LARGEST_BYTES, MOST_TIMES * os.fstat(file.fileno()).st_size)
                self._is_full = room < self._most
                self._left = self._most = max(0, min(room, self._most))

        def read(self, size: int = -1) -> bytes:
            """Read up to ``size`` bytes."""
            data: bytes = super().read(size)
            self._left -= len(data)
            if self._left < 0:
                where = f", the space available in {tempfile.gettempdir()}" if self._is_full else ""
                raise ValueError(f"it unpacks to more than {self._most >> 20} MB{where}")
            return data

    return BoundedFile
