"""Clouds in files for tables and surveys: Feather, Parquet, LAS and LAZ."""

from __future__ import annotations

import struct
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import numpy as np

from calibnet.datasets.clouds.columns import LONGEST_ROW, MOST_POINTS, CloudError, Columns
from calibnet.runtime.reading import MEGABYTE
from calibnet.runtime.text import one_line

LAS_HEADER, LAS_HEADER_1_4, LAS_POINT = 227, 375, 14
"""Sizes in bytes of the header of LAS 1.2 and 1.4, and of a point's position and intensity."""
COMPRESSED = 128
"""Smallest number of a compressed point format (LAZ)."""
LAS_RECORD, CHUNK_TABLE, AT_THE_END = 54, 8, -1
"""Sizes in bytes of a record's header and of the head of LAZ's table of chunks, and the offset of one that a stream has
at its end."""
POINTS_PER_BYTE = 8
"""Largest number of compressed points per byte of the file; a scan has less than one, even rounded to 5 cm."""
LEAST_SECONDS, LONGEST_SECONDS, LONGEST_WAIT, MEGABYTES_BESIDE = 3, 8, 60, 2048
"""Limits for unpacking a scan: CPU seconds for a small one, and at most, growing by one per megabyte; seconds in total
on a busy machine; and megabytes of memory besides its points. A megabyte of a valid scan takes a tenth of a second."""
UNPACK = """
import io, resource, sys
most, seconds = int(sys.argv[1]), int(sys.argv[2])
resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
import laspy
resource.setrlimit(resource.RLIMIT_AS, (most, most))
sys.stdout.buffer.write(laspy.read(io.BytesIO(sys.stdin.buffer.read())).points.array.tobytes())
"""


def read_feather(data: bytes) -> Columns:
    """Columns of a Feather file, as in Argoverse 2.

    Raises:
        CloudError: it is damaged, or has too many points.
    """
    from pyarrow import feather

    return read_table(feather.read_table, data)


def read_parquet(data: bytes) -> Columns:
    """Columns of a Parquet file; raises as `read_feather` does."""
    from pyarrow import parquet

    return read_table(parquet.read_table, data)


def read_las(data: bytes) -> Columns:
    """x, y, z and intensity of a LAS file; a compressed one is unpacked by another process, see `unpacked`.

    Raises:
        CloudError: it is damaged, or has too many points.
    """
    if len(data) < LAS_HEADER or data[:4] != b"LASF":
        raise CloudError("it is truncated or not a LAS file")
    start, kind = struct.unpack_from("<I", data, 96)[0], data[104]
    length, count = struct.unpack_from("<HI", data, 105)
    if data[25] >= 4 and len(data) >= LAS_HEADER_1_4:
        (count,) = struct.unpack_from("<Q", data, 247)
    scales, offsets = (np.frombuffer(data, "<f8", 3, at) for at in (131, 155))
    if count > MOST_POINTS:
        raise CloudError(f"its header states {count:,} points, but at most {MOST_POINTS:,} are read")
    if not LAS_POINT <= length <= LONGEST_ROW or not LAS_HEADER <= start <= len(data):
        raise CloudError("its header is damaged")
    if kind >= COMPRESSED:
        _check_compressed(data, start, count)
        points = unpacked(data, count * length)
    else:
        points = data[start : start + count * length]
    if len(points) < count * length:
        raise CloudError(f"it is truncated: its header states {count:,} points")
    layout = np.dtype({"names": ["xyz", "i"], "formats": [("<i4", 3), "<u2"], "offsets": [0, 12], "itemsize": length})
    table = np.frombuffer(points, layout, count)
    with np.errstate(over="ignore", invalid="ignore"):
        positions = table["xyz"] * scales + offsets
    return {"x": positions[:, 0], "y": positions[:, 1], "z": positions[:, 2], "intensity": table["i"]}


def _check_compressed(data: bytes, start: int, points: int) -> None:
    """Check what the library takes as given, and would follow for seconds: how many records, chunks and points.

    Args:
        data: content of the whole file.
        start: offset of the compressed points.
        points: their number according to the header.

    Raises:
        CloudError: the file is damaged.
    """
    head, records = struct.unpack_from("<H4xI", data, 94)
    if head + records * LAS_RECORD > start or points > len(data) * POINTS_PER_BYTE:
        raise CloudError("its header is damaged")
    table = struct.unpack_from("<q", data, start)[0] if start + CHUNK_TABLE <= len(data) else 0
    if table == AT_THE_END:
        table = struct.unpack_from("<q", data, len(data) - CHUNK_TABLE)[0]
    if not start < table <= len(data) - CHUNK_TABLE or struct.unpack_from("<4xI", data, table)[0] > max(points, 1):
        raise CloudError("it is truncated, or its table of chunks is damaged")


def unpacked(data: bytes, most: int) -> bytes:
    """The points of a LAZ file, in uncompressed form.

    Unpacked by a process of its own, since the library aborts or hangs on damaged files.

    Args:
        data: content of the whole file.
        most: number of bytes according to its header.

    Raises:
        CloudError: it is damaged.
    """
    seconds = min(LEAST_SECONDS + len(data) // MEGABYTE, LONGEST_SECONDS)
    limits = [str(most + MEGABYTES_BESIDE * MEGABYTE), str(seconds)]
    try:
        command = [sys.executable, "-c", UNPACK, *limits]
        done = subprocess.run(command, input=data, capture_output=True, check=False, timeout=LONGEST_WAIT)
    except subprocess.TimeoutExpired:
        raise CloudError(f"it cannot be unpacked within {LONGEST_WAIT} seconds, so it seems to be damaged") from None
    if done.returncode:
        raise CloudError("it is truncated or damaged")
    return done.stdout


def read_table(read: Callable[[Any], Any], data: bytes) -> Columns:
    """The numeric columns of a table.

    Args:
        read: reads a pyarrow table from an open file.
        data: of the file.

    Raises:
        CloudError: it is damaged, or has too many points.
    """
    import pyarrow as pa

    try:
        table = read(pa.BufferReader(data))
        table.validate(full=True)
    except (pa.ArrowException, OSError, ValueError) as error:
        raise CloudError(f"it is truncated, damaged or of another kind ({one_line(error, 160).rstrip('.')})") from None
    if table.num_rows > MOST_POINTS:
        raise CloudError(f"it has {table.num_rows:,} points, but at most {MOST_POINTS:,} are read")
    columns: Columns = {}
    names = [name.lower() for name in table.column_names]
    for name, column in zip(names, table.columns, strict=True):
        if names.count(name) > 1:
            raise CloudError(f"several of its columns are called {name!r}")
        if pa.types.is_floating(column.type) or pa.types.is_integer(column.type):
            columns[name] = column.to_numpy(zero_copy_only=False)
    return columns
