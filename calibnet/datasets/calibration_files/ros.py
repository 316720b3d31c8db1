"""ROS's ``camera_info``, as written by ``camera_calibration`` or printed by ``topic echo`` of ROS 1 and 2.

Its matrix ``K`` and lens belong to the raw images (``image_raw``); ``P`` is the matrix of those that
``image_proc`` rectified. All of them are of the whole sensor: if images show a region of it or are binned, they are
converted to the images as stored. It may also contain our own keys for the extrinsic.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

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

REGION = ("x_offset", "y_offset", "width", "height")
"""Keys of the part of the sensor that images show; a width and height of 0 mean all of it."""
BINNING = ("binning_x", "binning_y")
MATRICES = {"K": (3, 3), "k": (3, 3), "P": (3, 4), "p": (3, 4)}
"""Keys and sizes of the matrices that map to pixels."""


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
        DatasetError: it is incomplete or contradicts itself.
    """
    return CalibrationFile("ROS's camera_info", camera(content, path), values.extrinsic(content, path))


def camera(content: Mapping[Any, Any], path: Path, rectified: bool = False) -> CameraModel:
    """The camera of the images.

    Args:
        content: content of the file or message.
        path: path of the file.
        rectified: whether the images are already rectified, so that they have the matrix ``P`` and no distortion.

    Raises:
        DatasetError: it is incomplete or contradicts itself.
    """
    content = as_stored(content, path)
    keys = _keys(content, path)
    projection = values.numbers(content["P"], "P", path, (3, 4)) if rectified and content.get("P") else np.zeros((3, 4))
    of_rectified = bool(projection.any())
    matrix = (
        projection[:, :3] if of_rectified else values.numbers(content[keys["matrix"]], keys["matrix"], path, (3, 3))
    )
    if not matrix.any():
        raise DatasetError(
            f"Calibration {path}: the camera matrix is zero, which drivers write for an uncalibrated camera; "
            "calibrate it, and give its calibration file."
        )
    width, height = (values.pixels(content[keys[side]], side, path) for side in ("width", "height"))
    if of_rectified:
        return values.camera((width, height), matrix, "plumb_bob", [], path, "P")
    model = values.lens_model(content.get("distortion_model") or "plumb_bob", path, "distortion_model")
    taken = values.camera((width, height), matrix, model, content[keys["coefficients"]], path, keys["coefficients"])
    if rectified and not taken.is_pinhole:
        raise DatasetError(
            f"Calibration {path}: the images are rectified, but this camera_info has no matrix P; use the raw "
            "images, or give a calibration file of the rectified ones."
        )
    return taken


def as_stored(content: Mapping[Any, Any], path: Path) -> Mapping[Any, Any]:
    """The content for images as stored, if they show a region of the sensor or are binned.

    Raises:
        DatasetError: the region is not within the sensor.
    """
    roi = content.get("roi")
    roi = roi if isinstance(roi, Mapping) else {}
    x, y, width, height = (values.pixels(roi[key], f"roi.{key}", path) if roi.get(key) else 0 for key in REGION)
    binning = [values.pixels(content[key], key, path) if content.get(key) else 1 for key in BINNING]
    if not any((x, y, width, height)) and binning == [1, 1]:
        return content
    keys = _keys(content, path)
    whole = [values.pixels(content[keys[side]], side, path) for side in ("width", "height")]
    width, height = width or whole[0] - x, height or whole[1] - y
    if min(width, height) < 1 or x + width > whole[0] or y + height > whole[1]:
        raise DatasetError(
            f"Calibration {path}: the region {width}x{height} at ({x}, {y}) is not within {whole[0]}x{whole[1]}, so it "
            "is unclear which images the camera matrix is of; give a calibration file of the images as stored."
        )
    stored_from_whole = np.diag([1 / binning[0], 1 / binning[1], 1.0]) @ [[1, 0, -x], [0, 1, -y], [0, 0, 1]]
    matrices = {key: shape for key, shape in MATRICES.items() if content.get(key)}
    changed = {
        key: (stored_from_whole @ values.numbers(content[key], key, path, shape)).tolist()
        for key, shape in matrices.items()
    }
    size = {keys["width"]: width // binning[0], keys["height"]: height // binning[1]}
    return {**content, **changed, **size, **dict.fromkeys(("roi", *BINNING))}


def _keys(content: Mapping[Any, Any], path: Path) -> dict[str, str]:
    """The key of each part in `NAMES`.

    Raises:
        DatasetError: a part is missing.
    """
    found = {what: next((key for key in keys if key in content), "") for what, keys in NAMES.items()}
    for what, key in found.items():
        if not key:
            raise DatasetError(f"Calibration {path}: this camera_info has no {NAMES[what][0]}; export it again.")
    return found
