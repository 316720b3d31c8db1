"""Reading the ``calibration.yaml`` of a plain folder."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from calibnet.datasets.calibration import Calibration, checked_intrinsics, checked_rigid
from calibnet.datasets.unread_keys import in_words, unread_geometry
from calibnet.errors import DatasetError
from calibnet.geometry import PinholeCamera
from calibnet.geometry.types import Floats

DISTORTION_LENGTHS = (4, 5, 8)
"""OpenCV's models: k1 k2 p1 p2, then k3, then k4 k5 k6."""


@dataclass(frozen=True, eq=False)
class FolderCalibration:
    """The content of a ``calibration.yaml``.

    Attributes:
        width: image width in pixels.
        height: image height in pixels.
        calibration: camera matrix (valid after undistortion) and extrinsic.
        distortion: ``[4]``, ``[5]`` or ``[8]``, OpenCV's coefficients; zeros for rectified images.
    """

    width: int
    height: int
    calibration: Calibration
    distortion: Floats = field(repr=False)

    @property
    def camera(self) -> PinholeCamera:
        """Of the pictures once they are rectified."""
        return PinholeCamera(self.width, self.height, self.calibration.matrix)


def read_folder_calibration(path: Path) -> FolderCalibration:
    """Read ``width``, ``height``, ``camera_matrix`` (3x3), ``distortion`` and ``camera_from_lidar`` (4x4).

    Other keys are ignored, but for those that mean geometry elsewhere, see `calibnet.datasets.unread_keys`.

    Raises:
        DatasetError: the file or a key is missing, a value has the wrong form, or geometry would go unread.
    """
    try:
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise DatasetError(
            f"Calibration {path} cannot be read ({error.strerror}); write width, height, camera_matrix, "
            "distortion and camera_from_lidar there."
        ) from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        where = getattr(error, "problem_mark", None)
        line = f" (line {where.line + 1})" if where is not None else ""
        raise DatasetError(f"Calibration {path} is not valid YAML{line}; {_repair(path)}.") from None
    if not isinstance(content, dict):
        raise DatasetError(f"Calibration {path} is not a list of 'key: value' lines; repair it.")
    if unread := unread_geometry(content):
        raise DatasetError(f"Calibration {path} holds geometry that is not read: {in_words(unread)}.")
    matrix = _numbers(content, "camera_matrix", path, (3, 3))
    extrinsic = _numbers(content, "camera_from_lidar", path, (4, 4))
    distortion = _numbers(content, "distortion", path, *((length,) for length in DISTORTION_LENGTHS))
    return FolderCalibration(
        width=_pixels(content, "width", path),
        height=_pixels(content, "height", path),
        calibration=Calibration(
            checked_intrinsics(matrix, path, "camera_matrix"), checked_rigid(extrinsic, path, "camera_from_lidar")
        ),
        distortion=distortion,
    )


def _repair(path: Path) -> str:
    """What to do about a file that is no YAML; OpenCV's ``FileStorage`` writes a dialect of its own."""
    if path.read_bytes().startswith(b"%YAML:1.0"):
        return "it is OpenCV's dialect, so remove its first line and write matrices as lists of rows"
    return "repair it"


def _value(content: dict[str, Any], key: str, path: Path) -> Any:
    if content.get(key) is None:
        hint = " ([0, 0, 0, 0, 0] for rectified images)" if key == "distortion" else ""
        raise DatasetError(f"Calibration {path} has no key '{key}'; add it{hint}.")
    return content[key]


def _pixels(content: dict[str, Any], key: str, path: Path) -> int:
    value = _value(content, key, path)
    if not isinstance(value, int) or isinstance(value, bool) or value < 1:
        raise DatasetError(f"Calibration {path}: {key} is {value!r}; give a whole number of pixels.")
    return value


def _numbers(content: dict[str, Any], key: str, path: Path, *shapes: tuple[int, ...]) -> Floats:
    wanted = " or ".join("x".join(map(str, shape)) for shape in shapes)
    try:
        array = np.array(_value(content, key, path), dtype=np.float64)
    except (TypeError, ValueError):
        raise DatasetError(f"Calibration {path}: {key} is not {wanted} numbers; repair it.") from None
    if array.shape not in shapes:
        found = "x".join(map(str, array.shape)) or "one"
        raise DatasetError(f"Calibration {path}: {key} has {found} numbers instead of {wanted}; repair it.")
    if not np.isfinite(array).all():
        raise DatasetError(f"Calibration {path}: {key} holds a number that is not finite; repair it.")
    return array
