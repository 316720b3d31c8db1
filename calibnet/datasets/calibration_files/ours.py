"""The ``calibration.yaml`` of a plain folder."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from calibnet.datasets.calibration_files import values
from calibnet.datasets.calibration_files.calibration_file import CalibrationFile
from calibnet.datasets.calibration_files.unread_keys import in_words, unread_geometry
from calibnet.errors import DatasetError
from calibnet.geometry.camera_model import CameraModel, LensModel

KNOWN = ("fix", "prior_translation", "prior_rotation")
"""Keys of the prior, with the names of the command line's options."""
NEEDED = ("width", "height", "camera_matrix", "distortion")


def read(content: Mapping[Any, Any], path: Path) -> CalibrationFile:
    """Read ``width``, ``height``, ``camera_matrix`` (3x3), the lens, the extrinsic and optional keys.

    The lens is ``distortion_model`` (``plumb_bob`` by default), ``distortion``, and ``xi`` and ``alpha`` of the models
    that have them. Other keys are ignored, except those that mean geometry in other tools, see `unread_keys`. A file
    with only an extrinsic can serve as a guess.

    Raises:
        DatasetError: a key is missing, a value has the wrong form, or geometry would be ignored.
    """
    if unread := unread_geometry(content):
        raise DatasetError(f"Calibration {path} has geometry under keys that are not read: {in_words(unread)}.")
    rig = content.get("rig_from_camera")
    columns = content.get("cloud_columns")
    return CalibrationFile(
        "calibration.yaml",
        _camera(content, path),
        values.extrinsic(content, path),
        None if rig is None else values.pose(rig, path, "rig_from_camera"),
        None if columns is None else _columns(columns, path),
        {key: str(content[key]) for key in KNOWN if content.get(key) is not None},
        None if content.get("bayer") is None else _bayer(content["bayer"], path),
    )


def _camera(content: Mapping[Any, Any], path: Path) -> CameraModel | None:
    present = [key for key in NEEDED if content.get(key) is not None]
    if not present:
        return None
    model: LensModel = "plumb_bob"
    if content.get("distortion_model"):
        model = values.lens_model(content["distortion_model"], path, "distortion_model")
    missing = [key for key in NEEDED if key not in present and not (key == "distortion" and model == "double_sphere")]
    if missing:
        hint = " ([0, 0, 0, 0, 0] for rectified images)" if missing[0] == "distortion" else ""
        raise DatasetError(f"Calibration {path} has no key '{missing[0]}'; add it{hint}.")
    size = values.pixels(content["width"], "width", path), values.pixels(content["height"], "height", path)
    matrix = values.numbers(content["camera_matrix"], "camera_matrix", path, (3, 3))
    coefficients = values.coefficients_with(content, model, content.get("distortion"), path, "distortion")
    return values.camera(size, matrix, model, coefficients, path, "distortion")


def _bayer(pattern: Any, path: Path) -> str:
    from calibnet.datasets.images.development import BAYER  # loads OpenCV

    name = str(pattern).lower()
    if name not in BAYER:
        raise DatasetError(
            f"Calibration {path}: bayer is {pattern!r}; give one of {', '.join(BAYER)}, or leave it out."
        )
    return name


def _columns(columns: Any, path: Path) -> tuple[str, ...]:
    names = tuple(map(str, columns)) if isinstance(columns, list) else ()
    if len(set(names)) != len(names) or not {"x", "y", "z"} <= set(names):
        raise DatasetError(
            f"Calibration {path}: cloud_columns is {columns!r}; list the name of each column of a cloud, for "
            "instance [x, y, z, intensity, ring]."
        )
    return names
