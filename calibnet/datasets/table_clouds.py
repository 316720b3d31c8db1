"""Clouds in files made for tables and surveys: Feather, Parquet, LAS and LAZ."""

from __future__ import annotations

import io
import struct
from typing import Any

import numpy as np

from calibnet.datasets.cloud_table import MOST_POINTS, CloudError, Columns

LAS_HEADER, LAS_HEADER_1_4 = 227, 375
"""Bytes of the header of LAS 1.2 and of 1.4."""
MOST_RECORDS = 1000
"""Records of other things, such as coordinate systems, in a LAS file."""


def read_feather(data: bytes) -> Columns:
    """Columns of a Feather file, as Argoverse 2 has them.

    Raises:
        CloudError: it is damaged, or holds too many points.
    """
    from pyarrow import feather

    return _columns(feather.read_table, data)


def read_parquet(data: bytes) -> Columns:
    """Columns of a Parquet file; errors as of `read_feather`."""
    from pyarrow import parquet

    return _columns(parquet.read_table, data)


def read_las(data: bytes) -> Columns:
    """x, y, z and intensity of a LAS or LAZ file.

    Raises:
        CloudError: it is damaged, or holds too many points.
    """
    _check_las(data)
    import laspy

    try:
        with laspy.open(io.BytesIO(data)) as reader:
            _check(reader.header.point_count)
            las = reader.read()
            columns = {axis: np.asarray(getattr(las, axis), np.float64) for axis in "xyz"}
            return columns | {"intensity": np.asarray(las.intensity)}
    except (CloudError, MemoryError):
        raise
    except BaseException as error:  # laspy and its decompressor fail in many ways, a panic of Rust among them
        if isinstance(error, KeyboardInterrupt | SystemExit):
            raise
        raise CloudError(f"it is truncated, damaged or no LAS file ({error})") from None


def _check_las(data: bytes) -> None:
    """Hold the header's counts against the file before laspy follows them, however many they are."""
    if len(data) < LAS_HEADER or data[:4] != b"LASF":
        raise CloudError("it is truncated or no LAS file")
    size, points_at, records = struct.unpack_from("<HII", data, 94)
    minor, kind, length, legacy = data[25], data[104], *struct.unpack_from("<HI", data, 105)
    count, more_at, more = legacy, 0, 0
    if minor >= 4:
        if len(data) < LAS_HEADER_1_4:
            raise CloudError("it is truncated")
        more_at, more, count = struct.unpack_from("<QIQ", data, 235)
    if max(records, more) > MOST_RECORDS or not LAS_HEADER <= size <= points_at <= len(data):
        raise CloudError("its header is damaged")
    if size + records * 54 > points_at or (more and not points_at <= more_at <= len(data)):
        raise CloudError("its header is damaged")
    _check(count)
    if kind < 128 and points_at + count * length > len(data):  # beyond, it is compressed
        raise CloudError(f"it is truncated, its header promises {count:,} points")


def _columns(read: Any, data: bytes) -> Columns:
    """The columns of numbers of a table."""
    import pyarrow as pa

    try:
        table = read(pa.BufferReader(data))
    except (pa.ArrowException, OSError, ValueError) as error:
        raise CloudError(f"it is truncated, damaged or no such file ({error})") from None
    _check(table.num_rows)
    columns: Columns = {}
    for name in table.column_names:
        kind = table.schema.field(name).type
        if pa.types.is_floating(kind) or pa.types.is_integer(kind):
            columns.setdefault(name.lower(), table.column(name).to_numpy(zero_copy_only=False))
    return columns


def _check(points: int) -> None:
    if points > MOST_POINTS:
        raise CloudError(f"it holds {points:,} points, and {MOST_POINTS:,} are the most that are read")
