"""Reading LiDAR scans (``.bin``, ``.npy``, ``.pcd``, ``.ply``) as clean ``[N, 4]`` points."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calibnet.datasets.cloud_header import check_complete
from calibnet.errors import DatasetError

POINT_BYTES = 16
"""One point of a KITTI ``.bin``: x, y, z, intensity as float32."""

INTENSITY_NAMES = ("intensity", "reflectance", "reflectivity", "scalar_intensity", "scalar_reflectance", "i")
"""Names under which clouds store intensity, best first, in lower case."""

INTENSITY_SCALES = (1.0, 255.0, 65535.0)
"""Largest intensity by the way it is stored: a share, 8 bits, 16 bits."""
BRIGHT_SHARE = 0.99
"""Share of the points whose intensity has to fit."""


def read_scan(path: Path) -> NDArray[np.float32]:
    """Read a scan of any supported format.

    Returns:
        ``[N, 4]`` float32, N > 0, finite: x, y, z in metres and intensity 0..1 (0 where the file
        has none).

    Raises:
        DatasetError: the file is missing, truncated, empty, malformed or without a finite point.
    """
    try:
        size = path.stat().st_size
    except OSError as error:
        raise DatasetError(f"Scan {path} cannot be read ({error.strerror}); restore it.") from None
    if size == 0:
        raise DatasetError(f"Scan {path} is empty (0 bytes); remove the frame or copy the scan again.")
    return clean_points(_READERS[path.suffix.lower()](path), path)


def clean_points(points: NDArray[np.floating], path: Path) -> NDArray[np.float32]:
    """Drop rows of ``[N, 4]`` whose position is not finite and bring intensity to 0..1, 0 where it is not finite.

    Intensity is a share, or stored as 8 or as 16 bits. Which of them most points tell: a reflector may shine beyond.

    Raises:
        DatasetError: nothing is left; the message names ``path``.
    """
    if len(points) == 0:
        raise DatasetError(f"Scan {path} is empty; remove the frame or record it again.")
    finite = np.isfinite(points[:, :3])
    if not finite.all():
        points = points[finite.all(axis=1)]
        if len(points) == 0:
            raise DatasetError(f"Scan {path} has no finite point (all NaN or infinite); remove the frame.")
    clean = np.array(points, dtype=np.float32)
    intensity = clean[:, 3]
    intensity[~np.isfinite(intensity)] = 0.0
    if intensity.max() > 1.0:
        bright = np.quantile(intensity, BRIGHT_SHARE, method="lower")
        intensity /= next((scale for scale in INTENSITY_SCALES if bright <= scale), INTENSITY_SCALES[-1])
    np.clip(intensity, 0.0, 1.0, out=intensity)
    return clean


def _read_bin(path: Path) -> NDArray[np.float32]:
    data = path.read_bytes()
    if len(data) % POINT_BYTES:
        raise DatasetError(
            f"Scan {path} is truncated: {len(data)} bytes are no multiple of {POINT_BYTES} "
            "(x, y, z, intensity as float32); copy or download it again."
        )
    return np.frombuffer(data, np.float32).reshape(-1, 4)


def _read_npy(path: Path) -> NDArray[np.floating]:
    try:
        points = np.load(path, allow_pickle=False)
    except (ValueError, EOFError, OSError) as error:
        raise DatasetError(f"Scan {path} is truncated or not a .npy array ({error}); write it again.") from None
    if points.ndim != 2 or points.shape[1] < 3 or points.dtype.kind not in "fiu":
        raise DatasetError(
            f"Scan {path} is an array {points.shape} of {points.dtype}; save [N, 4] numbers: x, y, z, intensity."
        )
    return _with_intensity(points[:, :3], points[:, 3] if points.shape[1] > 3 else None)


def _read_open3d(path: Path) -> NDArray[np.floating]:
    check_complete(path)  # Open3D fills what a truncated file lacks with whatever is in memory
    import open3d as o3d

    with o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error):
        try:
            cloud = o3d.t.io.read_point_cloud(path)
        except RuntimeError as error:
            raise DatasetError(f"Scan {path} cannot be read by Open3D ({error}); write it again.") from None
    if cloud.is_empty():
        raise DatasetError(f"Scan {path} is empty or damaged; write it again or remove the frame.")
    attributes = {name.lower(): values for name, values in cloud.point.items()}
    name = next((name for name in INTENSITY_NAMES if name in attributes), None)
    return _with_intensity(cloud.point.positions.numpy(), None if name is None else attributes[name].numpy())


def _with_intensity(xyz: NDArray[np.floating], intensity: NDArray[np.floating] | None) -> NDArray[np.float32]:
    points = np.zeros((len(xyz), 4), np.float32)
    points[:, :3] = xyz
    if intensity is not None:
        points[:, 3] = intensity.reshape(-1)
    return points


_READERS: dict[str, Callable[[Path], NDArray[np.floating]]] = {
    ".bin": _read_bin,
    ".npy": _read_npy,
    ".pcd": _read_open3d,
    ".ply": _read_open3d,
}

SCAN_SUFFIXES = tuple(_READERS)
"""The file endings that `read_scan` reads."""
