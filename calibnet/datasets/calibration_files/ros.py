"""ROS's ``camera_info``, as written by ``camera_calibration`` or printed by ``topic echo`` of ROS 1 and 2.

Its matrix ``K`` and lens belong to the raw images (``image_raw``); ``P`` is the matrix of those that
``image_proc`` rectified. It may also contain our own keys for the extrinsic.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from calibnet.datasets.calibration_files import values
from calibnet.datasets.calibration_files.calibration_file import CalibrationFile
from calibnet.errors import DatasetError
from calibnet.geometry.camera_model import CameraModel

NAMES = {
    "width": ("image_width", "width"),
    "height": ("image_height", "height"),
    "matrix": ("camera_matrix", "K", "k"),
    "coefficients": ("distortion_coefficients", "D", "d"),
}


def is_known(content: Any) -> bool:
    """Whether the content is of a ``camera_info``."""
    if not isinstance(content, Mapping):
        return False
    calibrated = "image_width" in content and isinstance(content.get("camera_matrix"), Mapping)
    echoed = "distortion_model" in content and any(key in content for key in ("K", "k")) and "width" in content
    return calibrated or echoed


def read(content: Mapping[Any, Any], path: Path) -> CalibrationFile:
    """Read its camera, and the extrinsic if given.

    Raises:
        DatasetError: it is incomplete, or belongs to images that were binned or cropped.
    """
    return CalibrationFile("ROS's camera_info", camera(content, path), values.extrinsic(content, path))


def camera(content: Mapping[Any, Any], path: Path, rectified: bool = False) -> CameraModel:
    """The camera of the images.

    Args:
        content: content of the file or message.
        path: path of the file.
        rectified: whether the images are already rectified, so that they have the matrix ``P`` and no distortion.

    Raises:
        DatasetError: it is incomplete, or belongs to images that were binned or cropped.
    """
    found = {what: next((key for key in keys if key in content), None) for what, keys in NAMES.items()}
    for what, key in found.items():
        if key is None:
            raise DatasetError(f"Calibration {path}: this camera_info has no {NAMES[what][0]}; export it again.")
    roi = content.get("roi") or {}
    cut = [key for key in ("binning_x", "binning_y") if content.get(key) not in (None, 0, 1)]
    cut += [f"roi.{key}" for key in ("x_offset", "y_offset") if isinstance(roi, Mapping) and roi.get(key)]
    if cut:
        raise DatasetError(
            f"Calibration {path}: this camera_info belongs to images that were cropped or binned ({', '.join(cut)}); "
            "give the "
            "camera matrix of the images as stored, and set these to 0."
        )

    def value(what: str) -> Any:
        return content[found[what]]

    size = values.pixels(value("width"), "width", path), values.pixels(value("height"), "height", path)
    if rectified and content.get("P") and any(projection := values.numbers(content["P"], "P", path, (3, 4)).ravel()):
        return values.camera(size, projection.reshape(3, 4)[:, :3], "plumb_bob", [], path, "P")
    model = values.lens_model(content.get("distortion_model") or "plumb_bob", path, "distortion_model")
    matrix = values.numbers(value("matrix"), str(found["matrix"]), path, (3, 3))
    if not matrix.any():
        raise DatasetError(
            f"Calibration {path}: the camera matrix is zero, which drivers write for an uncalibrated camera; "
            "calibrate it, and give its calibration file."
        )
    taken = values.camera(size, matrix, model, value("coefficients"), path, str(found["coefficients"]))
    if rectified and not taken.is_pinhole:
        raise DatasetError(
            f"Calibration {path}: the images are rectified, but this camera_info has no matrix P; use the raw "
            "images, or give a calibration file of the rectified ones."
        )
    return taken
