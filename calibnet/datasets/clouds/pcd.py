"""Point clouds of PCL and ROS: ``.pcd`` as text, binary, and compressed by LZF.

Read without a native library, since these read past the end of the file if the header states too much.
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
"""Name of padding fields, which compressed data leaves out."""
STANDING = "0 0 0 1 0 0 0"
STANDS = 1e-3
"""Largest deviation of a viewpoint from the identity, in metres and in half radians."""
COMPRESSED_SIZES = struct.Struct("<II")
"""Compressed and uncompressed size of the data that follows."""


def read_pcd(data: bytes) -> Columns:
    """The columns of a ``.pcd`` file.

    Raises:
        CloudError: the header cannot be read, or the data does not match it.
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
    raise CloudError(f"its header has DATA {form[:40]!r} instead of ascii, binary or binary_compressed")


def _header(data: bytes) -> tuple[dict[str, list[str]], int]:
    """Words of every header line by the first one, and the offset of the data."""
    header: dict[str, list[str]] = {}
    start = 0
    while "DATA" not in header:
        end = data.find(b"\n", start, HEADER_BYTES)
        if end < 0:
            raise CloudError("it has no valid PCD header")
        words = data[start:end].decode("ascii", "replace").split()
        start = end + 1
        if words and not words[0].startswith("#"):
            header[words[0].upper()] = words[1:]
    return header, start


def _check_viewpoint(words: list[str]) -> None:
    """Check that there is no pose between the points and the LiDAR's frame.

    PCL's viewer takes the points to be in the frame of that pose, while other tools store them in world coordinates
    together with the LiDAR's pose; the file does not say which.

    Raises:
        CloudError: its position is not 0, 0, 0, or its quaternion (w first) is not the identity.
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
        f"its header has VIEWPOINT {' '.join(words)[:80]}, and tools do not agree on whether to apply it to the "
        f"points; give points in the LiDAR's frame, with VIEWPOINT {STANDING}"
    )


def _layout(header: dict[str, list[str]]) -> tuple[list[Column], int]:
    """Columns and number of points in the header."""
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
        raise CloudError(f"its PCD header has {points} points but a size of {width} x {height}")
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
        raise CloudError(f"its {points:,} points do not match the size of its compressed data ({unpacked:,} bytes)")
    if len(data) < COMPRESSED_SIZES.size + packed or unpacked > MOST_BYTES:
        raise CloudError(f"it is truncated, its header promises {points:,} points")
    return from_columns(unpack_lzf(data[COMPRESSED_SIZES.size :][:packed], unpacked), present, points)


def unpack_lzf(data: bytes, size: int) -> bytearray:
    """Decompress LZF, the compression of PCL.

    A control byte below 32 precedes that many plus one literal bytes. Any other one is a copy of earlier output: its
    upper three bits, plus a further byte if all are set, are the length minus 2; its lower five bits and the next byte
    are the distance minus 1.

    Args:
        data: compressed data.
        size: uncompressed size in bytes.

    Raises:
        CloudError: it is damaged, or has another size.
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
            else:  # overlapping copy, a repeating pattern
                pattern = out[start:]
                out += (pattern * (length // back + 1))[:length]
    except IndexError:
        raise CloudError("its compressed data is damaged") from None
    if len(out) != size or place != end:
        raise CloudError("its compressed data is damaged")
    return out
