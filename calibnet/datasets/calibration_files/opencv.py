"""Files of OpenCV's ``FileStorage`` (YAML 1.0, XML, JSON) and flat files that use its names, as our own JSON export."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from calibnet.datasets.calibration_files import values
from calibnet.datasets.calibration_files.calibration_file import CalibrationFile, Wanted
from calibnet.errors import DatasetError
from calibnet.geometry import invert

MATRIX = r"cameramat(rix)?|k|m1|intrinsics?|intrinsicmatrix|cam(era)?intrinsics?"
COEFFICIENTS = r"distortioncoeff(icient)?s?|distcoeffs?|distortion|d|d1|dist"
MODEL = r"distortionmodel|lensmodel|cameramodel"
WIDTH, HEIGHT, SIZE = r"(image|img|frame)?width", r"(image|img|frame)?height", r"(image|img|frame)size|resolution"
SECOND = "M2"
"""Matrix of the right camera in the file of a stereo pair."""
LIDAR_FROM_CAMERA = "CameraExtrinsicMat"
"""Key of Autoware.AI's calibration tool, which also writes ``CameraMat``, ``DistCoeff`` and ``ImageSize``."""


def is_known(content: Any, of_opencv: bool) -> bool:
    """Whether the content is of such a file: in OpenCV's dialect, or with a camera matrix under its names only."""
    if not isinstance(content, Mapping):
        return False
    exported = "convention" in content and "distortion_coefficients" in content
    return of_opencv or exported


def read(content: Mapping[Any, Any], path: Path, wanted: Wanted) -> CalibrationFile:
    """Read the camera and, if named, the extrinsic.

    Raises:
        DatasetError: there is no camera matrix, no distortion, or no size.
    """
    matrix_key, coefficients_key = _key(content, MATRIX), _key(content, COEFFICIENTS)
    if SECOND in content:
        raise DatasetError(f"Calibration {path} has two cameras (M1, {SECOND}); keep the matrix and lens of one.")
    extrinsic = values.extrinsic(content, path)
    if extrinsic is None and LIDAR_FROM_CAMERA in content:
        extrinsic = invert(values.pose(content[LIDAR_FROM_CAMERA], path, LIDAR_FROM_CAMERA))
    if matrix_key is None and extrinsic is not None:
        return CalibrationFile("OpenCV's file", None, extrinsic)
    for key, what in ((matrix_key, "camera_matrix"), (coefficients_key, "distortion_coefficients")):
        if key is None:
            raise DatasetError(f"Calibration {path}: this file of OpenCV has no {what}; add it under that name.")
    name = _key(content, MODEL)
    fisheye = any(str(key).lower() in ("fisheye", "fisheye_model") and content[key] in (1, True) for key in content)
    model = "equidistant" if fisheye else values.lens_model(content[name] if name else "plumb_bob", path, str(name))
    matrix = values.numbers(content[matrix_key], str(matrix_key), path, (3, 3))
    coefficients = values.coefficients_with(content, model, content[coefficients_key], path, str(coefficients_key))
    camera = values.camera(_size(content, path, wanted), matrix, model, coefficients, path, str(coefficients_key))
    return CalibrationFile("OpenCV's file", camera, extrinsic)


def _size(content: Mapping[Any, Any], path: Path, wanted: Wanted) -> tuple[int, int]:
    """Width and height; those of the images if the file has none."""
    width, height, size = (_key(content, names) for names in (WIDTH, HEIGHT, SIZE))
    if width is not None and height is not None:
        return values.pixels(content[width], str(width), path), values.pixels(content[height], str(height), path)
    if size is not None:
        sides = values.numbers(content[size], str(size), path, (2,)).tolist()
        return values.pixels(sides[0], str(size), path), values.pixels(sides[1], str(size), path)
    if wanted.size is None:
        raise DatasetError(
            f"Calibration {path} does not contain the size of the images; add image_width and image_height."
        )
    return wanted.size


def _key(content: Mapping[Any, Any], names: str) -> Any:
    """The key with one of these names, in lower case and without separators."""
    return next((key for key in content if re.fullmatch(names, re.sub(r"[\W_]", "", str(key)).lower())), None)
