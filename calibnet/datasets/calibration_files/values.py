"""Reads numbers, matrices, lenses and poses in the spellings of various tools."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation as ScipyRotation

from calibnet.datasets.calibration import checked_intrinsics, checked_rigid
from calibnet.errors import DatasetError
from calibnet.geometry import invert, transform
from calibnet.geometry.camera_model import COEFFICIENTS, OWN_COEFFICIENTS, CameraModel, LensModel
from calibnet.geometry.types import Extrinsic, Floats, Rotation, Transform

LENS_NAMES: dict[LensModel, str] = {
    "plumb_bob": r"plumbbob|radtan|radialtangential|brown(conrady)?|opencv|none|pinhole|perspective|rectified|"
    r"undistorted|linear|pinholeradtan",
    "rational_polynomial": r"rational(polynomial)?",
    "equidistant": r"equi(distant|dist)?|fisheye|kannalabrandt\d?|kb[48]?|pinholeequi|opencvfisheye",
    "omnidirectional": r"omni(directional|dir|radtan)?|mei|unified|catadioptric",
    "double_sphere": r"doublesphere|ds|dsnone",
}
"""Names of each lens model, in lower case and without separators."""


def numbers(value: Any, key: str, path: Path, *shapes: tuple[int, ...]) -> Floats:
    """An array of one of some shapes, from a flat or nested list or a mapping of OpenCV or ROS.

    Raises:
        DatasetError: the value is not such an array.
    """
    wanted = " or ".join("x".join(map(str, shape)) for shape in shapes)
    if isinstance(value, Mapping) and "data" in value:
        value = value["data"]
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise DatasetError(f"Calibration {path}: {key} is not a list of {wanted} numbers; correct it.") from None
    fitting = [shape for shape in shapes if array.size == int(np.prod(shape)) and (array.ndim == 1 or 1 in array.shape)]
    if array.shape not in shapes:
        if not fitting:
            found = "x".join(map(str, array.shape)) or "one"
            raise DatasetError(f"Calibration {path}: {key} has {found} numbers instead of {wanted}; correct it.")
        array = array.reshape(fitting[0])
    if not np.isfinite(array).all():
        raise DatasetError(f"Calibration {path}: {key} has a number that is not finite; correct it.")
    return array


def pixels(value: Any, key: str, path: Path) -> int:
    """A width or height in pixels."""
    if (isinstance(value, float) and value.is_integer()) or (
        isinstance(value, str) and re.fullmatch(r"\d{1,6}", value)
    ):
        value = int(value)
    if not isinstance(value, int) or isinstance(value, bool) or not 1 <= value <= 100_000:
        raise DatasetError(f"Calibration {path}: {key} is {value!r}; give a whole number of pixels.")
    return value


def lens_model(name: Any, path: Path, key: str) -> LensModel:
    """The lens model of a name.

    Raises:
        DatasetError: it is not supported.
    """
    plain = re.sub(r"[\W_]", "", str(name)).lower()
    for model, names in LENS_NAMES.items():
        if re.fullmatch(names, plain):
            return model
    raise DatasetError(
        f"Calibration {path}: {key} {name!r} is not a supported lens; give one of "
        f"{', '.join(COEFFICIENTS)}, or rectified images with 'distortion' [0, 0, 0, 0, 0]."
    )


def camera(
    size: tuple[int, int], matrix: Floats, model: LensModel, coefficients: Any, path: Path, key: str
) -> CameraModel:
    """A camera with a checked matrix and the number of coefficients of its lens; trailing zeros do not count.

    Args:
        size: width and height in pixels.
        matrix: camera matrix, 3x3.
        model: lens model.
        coefficients: coefficients in the file, in the model's own order.
        path: path of the file.
        key: name of the coefficients in the file.
    """
    if isinstance(coefficients, Mapping) and "data" in coefficients:
        coefficients = coefficients["data"]
    if coefficients is None or (isinstance(coefficients, list) and not coefficients):
        coefficients = [0.0] * COEFFICIENTS[model][0]  # ROS writes no coefficients for rectified images
    of_opencv = model in ("plumb_bob", "rational_polynomial")
    lengths = tuple(length for lens in ("plumb_bob", "rational_polynomial") for length in COEFFICIENTS[lens])
    lengths = lengths if of_opencv else COEFFICIENTS[model]
    found = np.asarray(coefficients, dtype=object).size
    if not of_opencv and found > lengths[-1]:
        flat = numbers(coefficients, key, path, (found,))
        if not flat[lengths[-1] :].any():
            coefficients = flat[: lengths[-1]].tolist()
    values = numbers(coefficients, key, path, *((length,) for length in lengths))
    if model == "double_sphere" and not 0.0 <= values[1] <= 1.0:
        raise DatasetError(f"Calibration {path}: alpha of a double sphere is {values[1]:g}; give a number from 0 to 1.")
    if model in ("omnidirectional", "double_sphere") and not -1.0 < values[0] < 10.0:
        raise DatasetError(f"Calibration {path}: xi of the lens is {values[0]:g}; give a number from -1 to 10.")
    if of_opencv:
        model = "plumb_bob" if len(values) <= COEFFICIENTS["plumb_bob"][-1] else "rational_polynomial"
    return CameraModel(*size, checked_intrinsics(matrix, path, "camera_matrix"), model, values)


def coefficients_with(content: Mapping[Any, Any], model: LensModel, distortion: Any, path: Path, key: str) -> Any:
    """Coefficients in the model's own order: ``xi`` and ``alpha`` of the mapping, if any, and then the distortion.

    Raises:
        DatasetError: one of them is missing.
    """
    own = []
    for name in OWN_COEFFICIENTS.get(model, ()):
        if content.get(name) is None:
            raise DatasetError(f"Calibration {path} has no key '{name}', which a {model} lens has; add it.")
        own.append(float(numbers([content[name]], name, path, (1,))[0]))
    if model == "double_sphere":
        return own
    return [*own, *numbers(distortion, key, path, (4,)).tolist()] if own else distortion


def matrix_of(intrinsics: Any, path: Path, key: str = "intrinsics") -> Floats:
    """Camera matrix of ``fx fy cx cy``, 3x3."""
    fx, fy, cx, cy = numbers(intrinsics, key, path, (4,))
    return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])


def quaternion(value: Any, order: str, path: Path, key: str) -> Rotation:
    """Rotation 3x3 of a unit quaternion in the order ``xyzw`` or ``wxyz``.

    Raises:
        DatasetError: its length is not 1.
    """
    values = numbers(value, key, path, (4,))
    length = float(np.linalg.norm(values))
    if abs(length - 1) > 1e-2:
        raise DatasetError(
            f"Calibration {path}: the quaternion {key} has length {length:.3g} instead of 1; correct it."
        )
    xyzw = values if order == "xyzw" else np.roll(values, -1)
    return np.asarray(ScipyRotation.from_quat(xyzw).as_matrix(), np.float64)


def roll_pitch_yaw(angles_rad: Floats) -> Rotation:
    """Rotation 3x3 of angles about the fixed axes x, y, z, in this order, as in ROS."""
    return np.asarray(ScipyRotation.from_euler("xyz", angles_rad).as_matrix(), np.float64)


def pose(value: Any, path: Path, key: str) -> Transform:
    """A rigid transform: 4x4 or 3x4 (also flat), or a mapping with a translation and a named rotation.

    The rotation is ``rotation`` (3x3), ``quaternion_xyzw``, ``quaternion_wxyz``, ``rpy_deg`` or ``rpy_rad`` (roll,
    pitch, yaw about fixed x, y, z, as in ROS).

    Raises:
        DatasetError: it is not of such a form, or not a rigid transform.
    """
    if isinstance(value, Mapping) and "data" not in value:
        return _of_parts(value, path, key)
    matrix = numbers(value, key, path, (4, 4), (3, 4))
    if len(matrix) == 3:
        matrix = np.vstack([matrix, [0.0, 0.0, 0.0, 1.0]])
    return checked_rigid(matrix, path, key)


def spelled_out(value: Mapping[Any, Any]) -> dict[Any, Any]:
    """The parts of a pose, with mappings x, y, z (w), as in ROS, converted to lists."""
    parts: dict[Any, Any] = {}
    for key, part in value.items():
        named = [axis for axis in "xyzw" if isinstance(part, Mapping) and axis in part]
        numbered = [part[axis] for axis in named] if named and len(named) == len(part) else part
        is_quaternion = key in ("rotation", "quaternion", "orientation") and len(named) == 4
        parts["quaternion_xyzw" if is_quaternion else key] = numbered
    return parts


def _of_parts(value: Mapping[Any, Any], path: Path, key: str) -> Transform:
    value = spelled_out(value)
    if "translation" not in value:
        raise DatasetError(f"Calibration {path}: {key} has no 'translation'; give x, y, z in metres.")
    if unknown := set(map(str, value)) - {"translation", *ROTATIONS}:
        raise DatasetError(f"Calibration {path}: {key} has an unknown '{min(unknown)}'; {_named_rotations()}.")
    named = [name for name in ROTATIONS if name in value]
    if len(named) != 1:
        raise DatasetError(f"Calibration {path}: {key} has {len(named)} rotations; {_named_rotations()}.")
    (name,) = named
    where = f"{key}.{name}"
    if name == "rotation":
        if np.asarray(value[name], dtype=object).size == 4:
            raise DatasetError(
                f"Calibration {path}: {where} has four numbers in an unknown order; call it "
                "'quaternion_xyzw' or 'quaternion_wxyz'."
            )
        rotation = numbers(value[name], where, path, (3, 3))
    elif name.startswith("quaternion"):
        rotation = quaternion(value[name], name.removeprefix("quaternion_"), path, where)
    else:
        angles = numbers(value[name], where, path, (3,))
        if name == "rpy_rad" and np.abs(angles).max() > 2 * np.pi:
            raise DatasetError(
                f"Calibration {path}: {where} is more than a full turn; call angles in degrees 'rpy_deg'."
            )
        rotation = roll_pitch_yaw(np.radians(angles) if name == "rpy_deg" else angles)
    translation = numbers(value["translation"], f"{key}.translation", path, (3,))
    return checked_rigid(transform(rotation, translation), path, key)


ROTATIONS = ("rotation", "quaternion_xyzw", "quaternion_wxyz", "rpy_deg", "rpy_rad")


def _named_rotations() -> str:
    return f"give 'translation' and one of {', '.join(ROTATIONS)}"


def extrinsic(content: Mapping[Any, Any], path: Path) -> Extrinsic | None:
    """``camera_from_lidar``, or the inverse of ``lidar_from_camera``; None without either.

    Raises:
        DatasetError: both are given and contradict each other, or one is malformed.
    """
    named = [key for key in ("camera_from_lidar", "lidar_from_camera") if content.get(key) is not None]
    if not named:
        return None
    found = pose(content[named[0]], path, named[0])
    found = found if named[0] == "camera_from_lidar" else invert(found)
    if len(named) == 2:
        other = invert(pose(content[named[1]], path, named[1]))
        if not np.allclose(found, other, atol=1e-3):
            raise DatasetError(
                f"Calibration {path}: camera_from_lidar and lidar_from_camera contradict each other; give one of them."
            )
    return found
