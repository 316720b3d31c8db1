"""Reads LiDAR scans of any format (`SCAN_SUFFIXES`) as clean ``[N, 4]`` points."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calibnet.datasets.clouds.bin import read_bin
from calibnet.datasets.clouds.columns import MOST_BYTES, CloudError, Columns, points_of
from calibnet.datasets.clouds.npy import read_npy, read_npz
from calibnet.datasets.clouds.pcd import read_pcd
from calibnet.datasets.clouds.ply import read_ply
from calibnet.datasets.clouds.tables import read_feather, read_las, read_parquet
from calibnet.datasets.clouds.text import TEXT_SUFFIXES, read_text
from calibnet.errors import DatasetError
from calibnet.runtime.reading import read_file

FARTHEST_M = 1e5
"""Largest coordinate in metres; larger ones mark points without a return, like NaN."""

INTENSITY_SCALES = (1.0, 255.0)
"""Largest intensity if stored as a share or in 8 bits; there is no such rule for wider ones."""
BRIGHT_SHARE = 0.99
"""Share of the points whose intensity must be within a scale; for a wider one, their largest intensity becomes 1."""


def read_scan(
    path: Path, columns: tuple[str, ...] | None = None, full_scale: float | None = None
) -> NDArray[np.float32]:
    """Read a scan of any supported format.

    Args:
        path: the file.
        columns: columns of a ``.bin`` or text file, see `calibnet.datasets.clouds.bin.read_bin`; None to recognise
            them.
        full_scale: intensity that becomes 1, see `full_scale_of`; None to find it from this scan alone.

    Returns:
        ``[N, 4]`` float32, N > 0, finite: x, y, z in metres and intensity 0..1 (0 where the file
        has none).

    Raises:
        DatasetError: the file is missing, truncated, empty, malformed or without a finite point.
    """
    return clean_points(read_raw(path, columns), path, full_scale)


def read_raw(path: Path, columns: tuple[str, ...] | None = None) -> NDArray[np.float32]:
    """The points of a file ``[N, 4]`` as stored, intensity included; arguments and errors are those of `read_scan`."""
    data = read_file(path, "Scan", MOST_BYTES)
    if not data:
        raise DatasetError(f"Scan {path} is empty (0 bytes); remove the frame, or copy the scan again.")
    try:
        suffix = ending(path, SCAN_SUFFIXES)
        if suffix in _BY_COLUMNS:
            return points_of(_BY_COLUMNS[suffix](data, columns))
        return _READERS[suffix](data)
    except CloudError as error:
        remedy = "" if ";" in str(error) else "; copy it again or write it anew"
        raise DatasetError(f"Scan {path} cannot be read: {error}{remedy}.") from None


def full_scale_of(intensities: NDArray[np.floating]) -> float:
    """The intensity that becomes 1, from those of many points ``[N]``: 1 for shares, 255 for 8 bits, else a bright one.

    Reflectors may exceed it, and a sensor of 16 bits hardly ever uses all of them.
    """
    known = intensities[np.isfinite(intensities)]
    bright = float(np.quantile(known, BRIGHT_SHARE, method="lower")) if len(known) else 0.0
    return next((scale for scale in INTENSITY_SCALES if bright <= scale), bright)


def clean_points(points: NDArray[np.floating], path: Path, full_scale: float | None = None) -> NDArray[np.float32]:
    """Drop points ``[N, 4]`` without a return (not finite, or at 0, 0, 0), and scale intensity to 0..1.

    An intensity that is not finite becomes 0.

    Raises:
        DatasetError: nothing is left; the message names ``path``.
    """
    if len(points) == 0:
        raise DatasetError(f"Scan {path} is empty; remove the frame or record it again.")
    places = points[:, :3]
    real = (np.abs(places) < FARTHEST_M).all(axis=1) & places.any(axis=1)  # false for NaN
    if not real.any() and (np.isfinite(places).all(axis=1) & places.any(axis=1)).any():
        raise DatasetError(
            f"Scan {path}: its points are more than {FARTHEST_M / 1e3:.0f} km away, like those of a map; give metres "
            "in the LiDAR's frame at the time of the image."
        )
    if not real.any():
        raise DatasetError(f"Scan {path} has no finite point (all NaN, infinite or 0, 0, 0); remove the frame.")
    points = points[real]
    clean = np.array(points, dtype=np.float32)
    intensity = clean[:, 3]
    intensity[~np.isfinite(intensity)] = 0.0
    intensity /= full_scale_of(intensity) if full_scale is None else full_scale
    np.clip(intensity, 0.0, 1.0, out=intensity)
    return clean


def ending(path: Path, suffixes: Sequence[str]) -> str:
    """The longest of some suffixes, in lower case, with which a file name ends; empty for none."""
    name = path.name.lower()
    return max((suffix for suffix in suffixes if name.endswith(suffix)), key=len, default="")


def _table(read: Callable[[bytes], Columns]) -> Callable[[bytes], NDArray[np.float32]]:
    """Make a reader of points from a reader of columns."""
    return lambda data: points_of(read(data))


_READERS: dict[str, Callable[[bytes], NDArray[np.float32]]] = {
    ".npy": read_npy,
    ".npz": read_npz,
    ".pcd": _table(read_pcd),
    ".ply": _table(read_ply),
    ".las": _table(read_las),
    ".laz": _table(read_las),
    ".feather": _table(read_feather),
    ".parquet": _table(read_parquet),
}

_BY_COLUMNS: dict[str, Callable[[bytes, tuple[str, ...] | None], Columns]] = {
    **dict.fromkeys((".bin", ".pcd.bin"), read_bin),  # KITTI's and nuScenes's
    **dict.fromkeys(TEXT_SUFFIXES, read_text),
}
"""Readers of formats whose columns may have to be declared, by suffix."""
SCAN_SUFFIXES = (*_BY_COLUMNS, *_READERS)
"""The file name suffixes that `read_scan` reads."""
