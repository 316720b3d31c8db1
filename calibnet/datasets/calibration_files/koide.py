"""``calib.json`` of koide3's direct_visual_lidar_calibration."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from calibnet.datasets.calibration_files import values
from calibnet.datasets.calibration_files.calibration_file import CalibrationFile, Wanted
from calibnet.errors import DatasetError
from calibnet.geometry import invert, transform
from calibnet.geometry.types import Extrinsic

RESULTS = ("T_lidar_camera", "init_T_lidar_camera", "init_T_lidar_camera_auto")
"""Poses of the camera in the LiDAR's frame, best first: x y z, then the quaternion x y z w."""


def is_known(content: Any) -> bool:
    """Whether the content is of koide3's ``calib.json``."""
    return isinstance(content, Mapping) and _is_camera(content.get("camera"))


def _is_camera(camera: Any) -> bool:
    return isinstance(camera, Mapping) and "camera_model" in camera and "intrinsics" in camera


def read(content: Mapping[Any, Any], path: Path, wanted: Wanted) -> CalibrationFile:
    """Read the camera, with the size of the images, and the result or else the initial guess.

    Raises:
        DatasetError: something is missing, or the lens is not supported.
    """
    of = content["camera"]
    model = values.lens_model(of["camera_model"], path, "camera.camera_model")
    coefficients = of.get("distortion_coeffs")
    intrinsics = of["intrinsics"]
    if model == "omnidirectional":
        *intrinsics, xi = values.numbers(intrinsics, "camera.intrinsics", path, (5,)).tolist()
        bent = coefficients or [0.0] * 4
        coefficients = [xi, *values.numbers(bent, "camera.distortion_coeffs", path, (4,)).tolist()]
    if wanted.size is None:
        raise DatasetError(
            f"{path} does not contain the size of the images, and there are no images beside it; add them."
        )
    matrix = values.matrix_of(intrinsics, path, "camera.intrinsics")
    camera = values.camera(wanted.size, matrix, model, coefficients, path, "camera.distortion_coeffs")
    return CalibrationFile("koide3's calib.json", camera, _extrinsic(content.get("results"), path))


def _extrinsic(results: Any, path: Path) -> Extrinsic | None:
    for name in RESULTS:
        if isinstance(results, Mapping) and results.get(name) is not None:
            numbers = values.numbers(results[name], f"results.{name}", path, (7,))
            rotation = values.quaternion(numbers[3:].tolist(), "xyzw", path, f"results.{name}")
            return invert(transform(rotation, numbers[:3]))
    return None
