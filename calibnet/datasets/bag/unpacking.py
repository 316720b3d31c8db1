"""Bags unpacked up to a bound, so that a small file can take neither all memory nor all of a disk."""

from __future__ import annotations

import os
import shutil
import tempfile
from bz2 import BZ2Decompressor
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

LARGEST_BYTES = 512 << 20
"""Largest unpacked chunk or message; recorders begin a new chunk after a few megabytes."""
STEP_BYTES = 16 << 20
MOST_TIMES = 100
"""What a whole packed file may grow by, beyond `LARGEST_BYTES`; pictures and scans shrink to a third or so."""
RESERVE_BYTES = 1 << 30
"""Room that is left on the disk of temporary files, to which whole bags are unpacked."""


def bound_unpacking() -> None:
    """Let rosbags and mcap unpack no piece and no file that is larger, of whatever bag they read from now on."""
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
    """A function that unpacks one piece.

    Args:
        make: a decompressor, with the methods that those of Python's own library have.
    """

    def unpack(data: bytes) -> bytes:
        unpacker = make()
        pieces = [unpacker.decompress(data, STEP_BYTES)]
        size = len(pieces[0])
        while not (unpacker.eof or unpacker.needs_input):
            pieces.append(unpacker.decompress(b"", STEP_BYTES))
            size += len(pieces[-1])
            if size > LARGEST_BYTES:
                raise ValueError(f"a piece of it unpacks to more than {LARGEST_BYTES >> 20} MB")
        if not unpacker.eof:
            raise ValueError("a packed piece of it is cut short")
        return b"".join(pieces)

    return unpack


def bounded_file(kind: Any) -> type[Any]:
    """A kind of packed file that is read up to a bound: what may be meant, and what the disk has room for.

    Args:
        kind: of files, which are read or written through another one.
    """

    class BoundedFile(kind):  # type: ignore[misc]  # rosbags brings its zstd without types
        """Counts what is read of it."""

        def __init__(self, file: Any, mode: str = "rb", **options: Any) -> None:
            super().__init__(file, mode, **options)
            self._left = 0
            if "r" in mode:
                room = shutil.disk_usage(tempfile.gettempdir()).free - RESERVE_BYTES
                self._most = max(LARGEST_BYTES, MOST_TIMES * os.fstat(file.fileno()).st_size)
                self._is_full = room < self._most
                self._left = self._most = max(0, min(room, self._most))

        def read(self, size: int = -1) -> bytes:
            """Up to so many bytes."""
            data: bytes = super().read(size)
            self._left -= len(data)
            if self._left < 0:
                where = f", all the room that {tempfile.gettempdir()} has for it" if self._is_full else ""
                raise ValueError(f"it unpacks to more than {self._most >> 20} MB{where}")
            return data

    return BoundedFile
