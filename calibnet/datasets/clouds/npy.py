"""NumPy's files of clouds: ``.npy``, also with named fields as made by ``ros_numpy``, and ``.npz``."""

from __future__ import annotations

import io
import math
import warnings
import zipfile
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from calibnet.datasets.clouds.columns import MOST_BYTES, MOST_COLUMNS, CloudError, Columns, joined, points_of

POSITIONS = ("xyz", "points", "positions")
"""Names of arrays ``[N, 3]`` with x, y and z, as of ros2_numpy."""
WIDEST = 16
"""Largest number of columns of an array of points."""


def read_npy(data: bytes) -> NDArray[np.float32]:
    """Points ``[N, 4]`` of an array ``[N, 3]`` or wider or its rows ``[H, W, 3]``, or of fields x, y, z, intensity.

    Raises:
        CloudError: it has another form, or is damaged.
    """
    return _points(read_array(data))


def read_npz(data: bytes) -> NDArray[np.float32]:
    """Points ``[N, 4]`` of the only array of a suitable shape, or of arrays called x, y, z (or xyz) and intensity.

    Raises:
        CloudError: there is none or several, the file is damaged, or it would unpack to more than a scan can have.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as file:
            arrays = dict(_arrays(file))
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError, EOFError, OSError, ValueError) as error:
        if isinstance(error, CloudError):
            raise
        raise CloudError("it is truncated or not a .npz archive") from None
    columns = _columns(arrays)
    if set("xyz") <= columns.keys():
        if len({len(columns[axis]) for axis in "xyz"}) > 1:
            raise CloudError("its x, y and z have different lengths")
        return points_of({name: column for name, column in columns.items() if len(column) == len(columns["x"])})
    tables = [name for name, array in arrays.items() if array.dtype.names or _is_table(array)]
    if len(tables) != 1:
        held = ", ".join(f"{name[:40]} {array.shape}" for name, array in list(arrays.items())[:6]) or "none"
        raise CloudError(f"it does not have exactly one array [N, 4] among {held}; save only the points")
    return _points(arrays[tables[0]])


def _arrays(file: zipfile.ZipFile) -> Iterator[tuple[str, NDArray[np.generic]]]:
    """The arrays of numbers in an archive, whose unpacked size is checked."""
    entries = file.infolist()
    if len(entries) > MOST_COLUMNS or sum(entry.file_size for entry in entries) > MOST_BYTES:
        raise CloudError(f"it would unpack to more than {MOST_BYTES >> 20} MB")
    for entry in entries:
        with file.open(entry) as packed:
            data = packed.read(entry.file_size)
        try:
            yield entry.filename.removesuffix(".npy"), read_array(data)
        except CloudError:
            continue  # ignore text and objects beside the points


def _is_table(array: NDArray[Any]) -> bool:
    return array.ndim == 2 and 3 <= array.shape[1] <= WIDEST


def _columns(arrays: Mapping[str, NDArray[Any]]) -> Columns:
    """Columns by name in lower case: arrays of single values, and the three of an array of `POSITIONS`."""
    columns: Columns = {}
    for name, array in arrays.items():
        if array.dtype.names:
            continue
        if array.ndim == 1 or (array.ndim == 2 and array.shape[1] == 1):
            columns.setdefault(name.lower(), array.ravel())
        elif name.lower() in POSITIONS and array.ndim == 2 and array.shape[1] == 3:
            columns |= {axis: array[:, place] for place, axis in enumerate("xyz")}
    return columns


def _points(array: NDArray[Any]) -> NDArray[np.float32]:
    if array.dtype.names:
        columns = _columns({name: np.asarray(array.ravel()[name]) for name in array.dtype.names})
        return points_of(columns)
    if array.ndim == 3 and 3 <= array.shape[2] <= WIDEST:
        array = array.reshape(-1, array.shape[2])
    if array.ndim == 2 and 3 <= array.shape[0] <= 8 and array.shape[1] > 8:
        raise CloudError(f"it is an array {array.shape}, which seems to be transposed; save [N, 4], one point per row")
    if array.ndim != 2 or array.shape[1] < 3:
        raise CloudError(f"it is an array {array.shape} of {array.dtype} instead of [N, 4] numbers: x, y, z, intensity")
    x, y, z = array[:, 0], array[:, 1], array[:, 2]
    return joined(x, y, z, array[:, 3] if array.shape[1] > 3 else None)


def read_array(data: bytes) -> NDArray[np.generic]:
    """The array of a ``.npy`` file, whose header is checked against its size before anything is allocated.

    Raises:
        CloudError: it is not such a file, or has another length.
    """
    file = io.BytesIO(data)
    try:
        version = npy.read_magic(file)
        read_header = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # about files of Python 2
            shape, by_column, dtype = read_header(file)
    except Exception:  # the header is a Python literal, which can fail in many ways
        raise CloudError("it is truncated or not a .npy array") from None
    length, promised = len(data) - file.tell(), math.prod(shape) * dtype.itemsize
    if dtype.hasobject:
        raise CloudError("it contains Python objects, which are not read; save an array [N, 4] of numbers")
    if dtype.kind not in "fiu" and not dtype.names:
        raise CloudError(f"it is an array of {str(dtype)[:40]}; save an array [N, 4] of numbers")
    if any(side < 0 for side in shape) or length != promised:
        what = f"an array {str(shape)[:60]} of {str(dtype)[:40]}"
        raise CloudError(f"its header states {what} of {promised} bytes, but it has {length}")
    return np.frombuffer(data, dtype, offset=file.tell()).reshape(shape, order="F" if by_column else "C")
