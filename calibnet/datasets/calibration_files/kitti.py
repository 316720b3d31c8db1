"""KITTI's ``calib.txt`` (odometry) and ``000000.txt`` (object): cameras ``P0`` to ``P3`` and one LiDAR."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from calibnet.datasets.calibration_files.calibration_file import CalibrationFile, Wanted
from calibnet.datasets.kitti.calibration import read_calibration_file, rectified_calibration
from calibnet.errors import DatasetError
from calibnet.geometry import transform
from calibnet.geometry.camera_model import CameraModel

LIDAR, OF_OBJECT, RECTIFYING = "Tr", "Tr_velo_to_cam", "R0_rect"


def is_known(content: Any) -> bool:
    """Whether the content is of a calibration file of KITTI."""
    if not isinstance(content, Mapping):
        return False
    return bool(_cameras(content)) and (LIDAR in content or {OF_OBJECT, RECTIFYING} <= content.keys())


def read(content: Mapping[Any, Any], path: Path, wanted: Wanted) -> CalibrationFile:
    """Read a camera, with the size of the images, and its extrinsic.

    Raises:
        DatasetError: a row is malformed, or the cameras differ and none is selected.
    """
    cameras = _cameras(content)
    named = None if wanted.camera is None else f"P{wanted.camera.removeprefix('P')}"
    if named not in cameras and (named is not None or len({content[name] for name in cameras}) > 1):
        numbers = ", ".join(name.removeprefix("P") for name in cameras)
        raise DatasetError(f"Calibration {path} has the cameras {numbers}; choose one with --camera.")
    name = named or cameras[0]
    sizes = {LIDAR: 12} if LIDAR in content else {OF_OBJECT: 12, RECTIFYING: 9}
    rows = read_calibration_file(path, {name: 12, **sizes})
    lidar = rows[LIDAR if LIDAR in rows else OF_OBJECT].reshape(3, 4)
    camera0_from_lidar = transform(lidar[:, :3], lidar[:, 3])
    if RECTIFYING in rows:
        camera0_from_lidar = transform(rows[RECTIFYING].reshape(3, 3), np.zeros(3)) @ camera0_from_lidar
    found = rectified_calibration(rows[name].reshape(3, 4), camera0_from_lidar)
    camera = None if wanted.size is None else CameraModel(*wanted.size, found.matrix)
    return CalibrationFile("KITTI's calibration", camera, found.camera_from_lidar)


def _cameras(content: Mapping[Any, Any]) -> list[str]:
    return [name for name in content if re.fullmatch(r"P\d", str(name))]
