"""The calibration of one camera and one LiDAR, and checks of its matrices."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from calibnet.errors import DatasetError, ImplausibleError
from calibnet.geometry.types import Extrinsic, Intrinsics, Rotation, Transform

RIGID_TOLERANCE = 2e-3
"""Largest entry of ``R^T R - I`` that counts as rounding, so that matrices with three decimals pass."""


@dataclass(frozen=True, eq=False)
class Calibration:
    """Intrinsics and extrinsic of a rectified camera.

    Attributes:
        matrix: 3x3 intrinsic matrix, pixels.
        camera_from_lidar: 4x4, metres.
    """

    matrix: Intrinsics = field(repr=False)
    camera_from_lidar: Extrinsic = field(repr=False)


def checked_intrinsics(matrix: Intrinsics, path: Path, key: str) -> Intrinsics:
    """Return the 3x3 ``matrix`` if it is that of a pinhole camera.

    Raises:
        DatasetError: it is singular or has another form; the message names ``path`` and ``key``.
    """
    focal_x, focal_y = matrix[0, 0], matrix[1, 1]
    if not np.array_equal(matrix[[1, 2, 2, 2], [0, 0, 1, 2]], [0.0, 0.0, 0.0, 1.0]):
        raise DatasetError(f"{path}: {key} is not a camera matrix; write it as [fx 0 cx; 0 fy cy; 0 0 1].")
    if not (focal_x > 0.0 and focal_y > 0.0):
        raise DatasetError(
            f"{path}: {key} is singular (focal lengths {focal_x:g} and {focal_y:g}); give positive focal lengths in "
            "pixels."
        )
    return matrix


def checked_rotation(rotation: Rotation, path: Path, key: str) -> Rotation:
    """Return the 3x3 ``rotation`` if it is orthonormal.

    Raises:
        DatasetError: it is not, or (as `ImplausibleError`) it mirrors; the message names ``path`` and ``key``.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        deviation = float(np.abs(rotation.T @ rotation - np.eye(3)).max())
    if not deviation <= RIGID_TOLERANCE:  # refuses NaN as well
        raise DatasetError(
            f"{path}: the rotation of {key} is not orthonormal (off by {deviation:.3g}); "
            "give a rotation matrix with at least four decimals."
        )
    if np.linalg.det(rotation) < 0.0:
        raise ImplausibleError(
            f"{path}: the rotation of {key} is a reflection (determinant -1), so one of its coordinate systems is "
            "left-handed; negate one of its axes.",
            "left-handed",
        )
    return rotation


def checked_rigid(matrix: Transform, path: Path, key: str) -> Transform:
    """Return the 4x4 ``matrix`` if it is a rigid transform.

    Raises:
        DatasetError: its last row or its rotation is wrong; the message names ``path`` and ``key``.
    """
    if not np.array_equal(matrix[3], [0.0, 0.0, 0.0, 1.0]):
        raise DatasetError(f"{path}: the last row of {key} is not 0 0 0 1; give a 4x4 rigid transform in metres.")
    checked_rotation(matrix[:3, :3], path, key)
    return matrix
