"""Pieces of a bag unpacked up to a bound, so that a small file cannot take all memory."""

from __future__ import annotations

from bz2 import BZ2Decompressor
from collections.abc import Callable
from typing import Any

LARGEST_BYTES = 512 << 20
"""Of an unpacked chunk or message; recorders begin a new chunk after a few megabytes."""
STEP_BYTES = 16 << 20


def bound_unpacking() -> None:
    """Let rosbags unpack no piece that is larger, of whatever bag it reads from now on."""
    from lz4.frame import LZ4FrameDecompressor  # type: ignore[import-untyped]
    from rosbags.rosbag1.reader import decompressors
    from rosbags.rosbag2 import reader
    from rosbags.rosbag2.storage_mcap import DECOMPRESSORS

    zstd: Any = vars(reader)["zstd"]
    lz4, zstd.decompress = bounded(LZ4FrameDecompressor), bounded(zstd.ZstdDecompressor)
    decompressors.update(bz2=bounded(BZ2Decompressor), lz4=lz4)
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
