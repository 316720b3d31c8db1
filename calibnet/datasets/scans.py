"""Reading LiDAR scans of any format (`SCAN_SUFFIXES`) as clean ``[N, 4]`` points."""

from __future__ import annotations

import io
import math
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from calibnet.datasets.bin_clouds import read_bin
from calibnet.datasets.cloud_table import MOST_BYTES, CloudError, Columns
from calibnet.datasets.pcd import read_pcd
from calibnet.datasets.ply import read_ply
from calibnet.datasets.table_clouds import read_feather, read_las, read_parquet
from calibnet.errors import DatasetError
from calibnet.runtime.reading import read_file

FARTHEST_M = 1e5
"""Coordinates beyond are marks of points without a return, as NaN is."""

INTENSITY_NAMES = ("intensity", "reflectance", "reflectivity", "scalar_intensity", "scalar_reflectance", "i")
"""Names under which clouds store intensity, best first, in lower case."""

INTENSITY_SCALES = (1.0, 255.0)
"""Largest intensity of those that are stored as a share and as 8 bits. There is no such rule for wider ones."""
BRIGHT_SHARE = 0.99
"""Share of the points whose intensity has to fit; what most of a wider one's points stay below counts as 1."""


def read_scan(
    path: Path, columns: tuple[str, ...] | None = None, full_scale: float | None = None
) -> NDArray[np.float32]:
    """Read a scan of any supported format.

    Args:
        path: the file.
        columns: of a ``.bin``, see `calibnet.datasets.bin_clouds.read_bin`; None to recognise them.
        full_scale: intensity that counts as 1, see `full_scale_of`; None to judge by this scan alone.

    Returns:
        ``[N, 4]`` float32, N > 0, finite: x, y, z in metres and intensity 0..1 (0 where the file
        has none).

    Raises:
        DatasetError: the file is missing, truncated, empty, malformed or without a finite point.
    """
    return clean_points(read_raw(path, columns), path, full_scale)


def read_raw(path: Path, columns: tuple[str, ...] | None = None) -> NDArray[np.float32]:
    """The points of a file ``[N, 4]`` as they are stored, intensity included; arguments and errors of `read_scan`."""
    data = read_file(path, "Scan", MOST_BYTES)
    if not data:
        raise DatasetError(f"Scan {path} is empty (0 bytes); remove the frame or copy the scan again.")
    try:
        if ending(path, SCAN_SUFFIXES) in BIN_SUFFIXES:
            return points_of(read_bin(data, columns))
        return _READERS[path.suffix.lower()](data)
    except CloudError as error:
        raise DatasetError(f"Scan {path} cannot be read: {error}; copy it again or write it anew.") from None


def full_scale_of(intensities: NDArray[np.floating]) -> float:
    """The intensity that counts as 1, of many points' ``[N]``: 1 of shares, 255 of 8 bits, and else what is bright.

    A reflector may shine beyond it, and a sensor of 16 bits hardly ever uses them.
    """
    known = intensities[np.isfinite(intensities)]
    bright = float(np.quantile(known, BRIGHT_SHARE, method="lower")) if len(known) else 0.0
    return next((scale for scale in INTENSITY_SCALES if bright <= scale), bright)


def clean_points(points: NDArray[np.floating], path: Path, full_scale: float | None = None) -> NDArray[np.float32]:
    """Drop rows of ``[N, 4]`` whose position is not finite and bring intensity to 0..1, 0 where it is not finite.

    Raises:
        DatasetError: nothing is left; the message names ``path``.
    """
    if len(points) == 0:
        raise DatasetError(f"Scan {path} is empty; remove the frame or record it again.")
    finite = np.abs(points[:, :3]) < FARTHEST_M  # false for NaN
    if not finite.all():
        points = points[finite.all(axis=1)]
        if len(points) == 0:
            raise DatasetError(f"Scan {path} has no finite point (all NaN or infinite); remove the frame.")
    clean = np.array(points, dtype=np.float32)
    intensity = clean[:, 3]
    intensity[~np.isfinite(intensity)] = 0.0
    intensity /= full_scale_of(intensity) if full_scale is None else full_scale
    np.clip(intensity, 0.0, 1.0, out=intensity)
    return clean


def _read_npy(data: bytes) -> NDArray[np.float32]:
    points = read_array(data)
    if points.ndim == 2 and 3 <= points.shape[0] <= 8 and points.shape[1] > 8:
        raise CloudError(f"it is an array {points.shape}, which seems to be transposed; save [N, 4], a point a row")
    if points.ndim != 2 or points.shape[1] < 3 or points.dtype.kind not in "fiu":
        raise CloudError(f"it is an array {points.shape} of {points.dtype} and not [N, 4] numbers: x, y, z, intensity")
    x, y, z = points[:, :3].T
    return _joined(x, y, z, points[:, 3] if points.shape[1] > 3 else None)


def read_array(data: bytes) -> NDArray[np.generic]:
    """The array of a ``.npy`` file; its header is held against its bytes before anything is allocated.

    Raises:
        CloudError: it is no such file, or has another length.
    """
    file = io.BytesIO(data)
    try:
        version = npy.read_magic(file)
        read_header = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that Python 2 wrote it
            shape, by_column, dtype = read_header(file)
    except Exception:  # the header is a Python literal, and fails in as many ways
        raise CloudError("it is truncated or not a .npy array") from None
    length, promised = len(data) - file.tell(), math.prod(shape) * dtype.itemsize
    if dtype.hasobject or dtype.kind not in "fiu" or any(side < 0 for side in shape) or length != promised:
        what = f"an array {str(shape)[:60]} of {str(dtype)[:40]}"
        raise CloudError(f"its header promises {what}, of {promised} bytes, and it holds {length}")
    return np.frombuffer(data, dtype, offset=file.tell()).reshape(shape, order="F" if by_column else "C")


def ending(path: Path, suffixes: Sequence[str]) -> str:
    """The longest of some endings, in lower case, that a file's name has; empty for none."""
    name = path.name.lower()
    return max((suffix for suffix in suffixes if name.endswith(suffix)), key=len, default="")


def _table(read: Callable[[bytes], Columns]) -> Callable[[bytes], NDArray[np.float32]]:
    """A reader of columns as a reader of points."""
    return lambda data: points_of(read(data))


def points_of(columns: Columns) -> NDArray[np.float32]:
    """``[N, 4]`` of columns by name; intensity 0 where there is none.

    Raises:
        CloudError: a coordinate is missing.
    """
    if missing := [axis for axis in "xyz" if axis not in columns]:
        raise CloudError(f"it has no column {', '.join(missing)}, only {', '.join(columns) or 'none'}")
    intensity = next((columns[name] for name in INTENSITY_NAMES if name in columns), None)
    return _joined(columns["x"], columns["y"], columns["z"], intensity)


def _joined(
    x: NDArray[np.generic], y: NDArray[np.generic], z: NDArray[np.generic], intensity: NDArray[np.generic] | None
) -> NDArray[np.float32]:
    points = np.zeros((len(x), 4), np.float32)
    with np.errstate(over="ignore"):  # what is too large becomes infinite, and is dropped as such
        for place, values in enumerate((x, y, z) if intensity is None else (x, y, z, intensity)):
            points[:, place] = values
    return points


_READERS: dict[str, Callable[[bytes], NDArray[np.float32]]] = {
    ".npy": _read_npy,
    ".pcd": _table(read_pcd),
    ".ply": _table(read_ply),
    ".las": _table(read_las),
    ".laz": _table(read_las),
    ".feather": _table(read_feather),
    ".parquet": _table(read_parquet),
}

BIN_SUFFIXES = (".bin", ".pcd.bin")
"""KITTI's and nuScenes's."""
SCAN_SUFFIXES = (*BIN_SUFFIXES, *_READERS)
"""The file endings that `read_scan` reads."""
