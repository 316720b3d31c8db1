"""Point clouds as PCL and ROS write them: ``.pcd`` as text, binary, and compressed by LZF.

Read here and by no native library: of a header that promises what the bytes do not hold, those read past the end.
"""

from __future__ import annotations

import math
import struct

import numpy as np

from calibnet.datasets.clouds.columns import (
    LONGEST_WORD,
    MOST_BYTES,
    CloudError,
    Column,
    Columns,
    check_table,
    from_columns,
    from_rows,
    from_text,
    whole_number,
)

HEADER_BYTES = 64 * 1024
DTYPES = {
    **{("F", size): np.dtype(f"<f{size}") for size in (4, 8)},
    **{("I", size): np.dtype(f"<i{size}") for size in (1, 2, 4, 8)},
    **{("U", size): np.dtype(f"<u{size}") for size in (1, 2, 4, 8)},
}
PADDING = "_"
"""Name of what only fills a row; compressed data leaves it out."""
STANDING = "0 0 0 1 0 0 0"
STANDS = 1e-3
"""Metres, and radians over two, that are no pose."""
COMPRESSED_SIZES = struct.Struct("<II")
"""Bytes of the compressed data that follow, and of what they hold."""


def read_pcd(data: bytes) -> Columns:
    """The columns of a ``.pcd`` file.

    Raises:
        CloudError: the header cannot be read, or the data is not what it promises.
    """
    header, start = _header(data)
    _check_viewpoint(header.get("VIEWPOINT", []))
    columns, points = _layout(header)
    form = " ".join(header.get("DATA", [])).lower()
    if form == "ascii":
        return from_text(data[start:], columns, points)
    if form == "binary":
        return from_rows(memoryview(data)[start:], columns, points)
    if form == "binary_compressed":
        return _compressed(data[start:], columns, points)
    raise CloudError(f"its header says DATA {form[:40]!r}, which is none of ascii, binary and binary_compressed")


def _header(data: bytes) -> tuple[dict[str, list[str]], int]:
    """Words of every line by their first one, and where the data begins."""
    header: dict[str, list[str]] = {}
    start = 0
    while "DATA" not in header:
        end = data.find(b"\n", start, HEADER_BYTES)
        if end < 0:
            raise CloudError("it has no PCD header that can be read")
        words = data[start:end].decode("ascii", "replace").split()
        start = end + 1
        if words and not words[0].startswith("#"):
            header[words[0].upper()] = words[1:]
    return header, start


def _check_viewpoint(words: list[str]) -> None:
    """See that no pose stands between the points and the LiDAR's frame.

    PCL's viewer takes the points to be in the frame of that pose, others store them in the world and the LiDAR's place
    there in it: which of them wrote a file, it does not say.

    Raises:
        CloudError: its position is not 0, 0, 0, or its quaternion (w first) turns.
    """
    if words in ([], ["0"] * 7):
        return
    try:
        *position, w, x, y, z = (float(word[:LONGEST_WORD]) for word in words)
        stands = len(position) == 3 and math.hypot(*position) < STANDS and abs(w) > 0
        if stands and math.hypot(x, y, z) < STANDS * abs(w):
            return
    except ValueError:
        pass
    raise CloudError(
        f"its header says VIEWPOINT {' '.join(words)[:80]}, and tools do not agree on whether its points are to be "
        f"moved by that; give them as the LiDAR sees them, with VIEWPOINT {STANDING}"
    )


def _layout(header: dict[str, list[str]]) -> tuple[list[Column], int]:
    """Columns and number of points."""
    names = [name.lower() for name in header.get("FIELDS", [])]
    sizes, kinds = header.get("SIZE", []), header.get("TYPE", [])
    counts = header.get("COUNT", ["1"] * len(names))
    if not names or not len(names) == len(sizes) == len(kinds) == len(counts):
        raise CloudError("its PCD header has no FIELDS, SIZE, TYPE and COUNT of the same length")
    columns = []
    for name, size, kind, count in zip(names, sizes, kinds, counts, strict=True):
        dtype = DTYPES.get((kind.upper(), whole_number(size)))
        if dtype is None:
            raise CloudError(f"its PCD header gives field {name[:40]!r} the type {kind[:8]}{size[:8]}")
        columns.append(Column(name, dtype, whole_number(count)))
    width, height = (whole_number(" ".join(header.get(key, ["1"]))) for key in ("WIDTH", "HEIGHT"))
    points = whole_number(header["POINTS"][0]) if header.get("POINTS") else width * height
    if "WIDTH" in header and points != width * height:
        raise CloudError(f"its PCD header promises {points} points and {width} x {height} of them")
    check_table(columns, points)
    return columns, points


def _compressed(data: bytes, columns: list[Column], points: int) -> Columns:
    if len(data) < COMPRESSED_SIZES.size:
        raise CloudError(f"it is truncated, its header promises {points:,} points")
    packed, unpacked = COMPRESSED_SIZES.unpack_from(data)
    present = [column for column in columns if column.name != PADDING]
    if unpacked == points * sum(column.size for column in columns):
        present = columns
    elif unpacked != points * sum(column.size for column in present):
        raise CloudError(f"its {points:,} points are not what its compressed data says to hold ({unpacked:,} bytes)")
    if len(data) < COMPRESSED_SIZES.size + packed or unpacked > MOST_BYTES:
        raise CloudError(f"it is truncated, its header promises {points:,} points")
    return from_columns(unpack_lzf(data[COMPRESSED_SIZES.size :][:packed], unpacked), present, points)


def unpack_lzf(data: bytes, size: int) -> bytearray:
    """Undo LZF, the compression of PCL.

    A control byte below 32 stands before one byte more than it says; another one for a copy of what was unpacked
    before: its upper three bits, with a further byte where all are set, are the length minus 2, its lower five and the
    byte after them how far back, minus 1.

    Args:
        data: compressed.
        size: bytes that it holds.

    Raises:
        CloudError: it is damaged, or holds another number of bytes.
    """
    out = bytearray()
    place, end = 0, len(data)
    try:
        while place < end:
            control = data[place]
            place += 1
            if control < 32:
                out += data[place : place + control + 1]
                place += control + 1
                continue
            length = control >> 5
            if length == 7:
                length += data[place]
                place += 1
            back = ((control & 31) << 8) + data[place] + 1
            place += 1
            length += 2
            start = len(out) - back
            if start < 0 or len(out) + length > size:
                raise IndexError
            if back >= length:
                out += out[start : start + length]
            else:  # it overlaps itself: a pattern that repeats
                pattern = out[start:]
                out += (pattern * (length // back + 1))[:length]
    except IndexError:
        raise CloudError("its compressed data is damaged") from None
    if len(out) != size or place != end:
        raise CloudError("its compressed data is damaged")
    return out
