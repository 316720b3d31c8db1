"""Finds keys of a ``calibration.yaml`` that mean geometry in other tools but are not read here.

Other tools use other names for the same values (`camera_info` of ROS, Kalibr, OpenCV). If ``dist_coeffs`` were ignored,
for instance, a camera without its distortion would be calibrated.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

READ = frozenset(
    {
        *("width", "height", "camera_matrix", "distortion_model", "distortion", "xi", "alpha"),
        *("camera_from_lidar", "lidar_from_camera", "rig_from_camera", "cloud_columns"),
        *("fix", "prior_translation", "prior_rotation"),
    }
)
"""The keys that are read."""

SIZE = "'width' and 'height' in pixels"
MATRIX = "'camera_matrix' as [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]"
LENS = "'distortion_model' and 'distortion', for instance plumb_bob with OpenCV's k1, k2, p1, p2, k3"
EXTRINSIC = "'camera_from_lidar' as the 4x4 matrix that maps LiDAR points into the camera, in metres"
INVERSE = "its inverse as 'camera_from_lidar'"
RECTIFIED = "rectified images with their 'camera_matrix'"
WHOLE = "the 'camera_matrix' of the images as stored"
STRAIGHT = "'distortion_model' as one of plumb_bob, rational_polynomial, equidistant, omnidirectional, double_sphere"

_CAM, _LIDAR = r"(camera|cam|image)\d*", r"(lidar|velodyne|velo|laser|livox|ouster|hesai|pandar|ldr)\d*"
_A, _OF = (
    r"(t|tf|tr|transform|extrinsics?|pose)",
    r"(mat(rix)?|extrinsics?|transform\w*|calib\w*|pose|tf|rot\w*|trans\w*)?",
)
NAMES: tuple[tuple[str, tuple[str, ...]], ...] = (
    (SIZE, (r"(image|img|picture|camera)?(width|height|size|shape)", r"resolution|rows|cols|columns|w|h")),
    (MATRIX, (r"k(0\d)?|mtx|intrinsics?|intrinsic(mat|param)\w*", r"cam(era)?(k|mat(rix)?\w*|intrinsics?|info\w*)")),
    (MATRIX, (r"[fc][xyuv]?|[uv]0|pp[xy]|skew", r"focal\w*|principal\w*|(optical)?cent(er|re)[xyuv]?")),
    (f"{LENS}, and a projection of KITTI as 'camera_matrix' (its left 3x3)", (r"p[12]",)),
    (LENS, (r"(lens|camera|cam)?dist(ort|ors)\w*|\w*distortion\w*", r"d(0\d)?|k[1-9]|s[1-4]|xi|alpha|beta")),
    (LENS, (r"(camera|cam)?dist(coeffs?|coefs?|coefficients?|params?)?", r"coeff\w*|(radial|tangential)\w*")),
    (RECTIFIED, (r"p\d?|p(roj(ection)?)?(mat(rix)?|rect\w*)|(new|optimal)cam\w*", r"r?rect(ification)?(mat(rix)?)?")),
    (RECTIFIED, (r"rrect\w*|r0\w*",)),
    (STRAIGHT, (r"(is)?fisheye\w*|omni\w*|equidistant\w*|kannala\w*",)),
    (WHOLE, (r"binning[xy]?|roi\w*|crop\w*|[xy]offset|offset[xy]", r"resiz\w*|(image|picture)?scale\w*|downsampl\w*")),
    (INVERSE, (rf"({_A}?{_LIDAR}(from|in)|{_A}{_LIDAR}){_CAM}{_OF}", rf"{_A}?{_CAM}(to|2){_LIDAR}{_OF}")),
    (EXTRINSIC, (rf"{_A}?{_CAM}(from)?{_LIDAR}{_OF}", rf"{_A}?{_LIDAR}(to|2)?{_CAM}{_OF}", rf"extrinsics?{_OF}")),
    (EXTRINSIC, (r"[rpt]cl", r"t|tf|tr|rt|pose|transform\w*", rf"t({_CAM}|{_LIDAR}|bs|body|imu|base|ic|vehicle)\w*")),
    (EXTRINSIC, (r"r|q|[tq][wxyz]|[rt]vecs?|rpy|roll|pitch|yaw|euler", r"(rot|trans)(ation|lation)?s?|quaternions?")),
)  # fmt: skip
"""The right keys instead of names that match these patterns, in lower case and without ``_``; the first match
counts."""

LENSES_READ = re.compile(
    r"plumbbob|radtan|radialtangential|rational(polynomial)?|brown(conrady)?|opencv|"
    r"none|pinhole|perspective|rectified|undistorted|linear"
)
"""Values of ``distortion_model`` for which OpenCV's coefficients suffice."""
OTHER_LENSES = re.compile(
    r"fish|equi|omni|unified|doublesphere|kannala|brandt|spher|panoram|scaramuzza|ocam|catadioptric|thinprism|division|"
    r"cylind|^(mei|e?ucm|ds|kb\d?|fov|atan|ftheta)$"
)
"""Names of lenses that OpenCV's coefficients do not describe."""
MODEL = re.compile(r"(camera|lens|distortion|projection|dist|cam|intrinsics?)?(model|type)|lens")
"""Keys whose value may name a lens model rather than a maker."""


class Unread(NamedTuple):
    """A key with its parents (``cam0.intrinsics``), and the right key instead."""

    key: str
    remedy: str


def unread_geometry(content: Mapping[Any, Any], parent: str = "") -> list[Unread]:
    """The geometry in a calibration file that would be ignored; empty for most files.

    Args:
        content: content of the file, or of a key in it.
        parent: name of that key and a dot.
    """
    found = []
    lens_is_said = not parent and bool(content.get("distortion_model"))
    for name, value in content.items():
        key, plain = f"{parent}{name}", _plain(name)
        if _says_nothing(value) or (not parent and name in READ):
            continue
        if lens_is_said and (MODEL.fullmatch(plain) or _remedy(plain, value) == STRAIGHT):
            continue
        if MODEL.fullmatch(plain) and isinstance(value, str):
            if not _is_read(plain, value):
                found.append(Unread(f"{key}: {value}", STRAIGHT))
        elif remedy := _remedy(plain, value):
            found.append(Unread(key, remedy))
        elif isinstance(value, Mapping):
            found += unread_geometry(value, f"{key}.")
    return found


def in_words(unread: Sequence[Unread]) -> str:
    """The keys and the right ones instead, as the end of a sentence."""
    keys: dict[str, list[str]] = {}
    for key, remedy in unread:
        keys.setdefault(remedy, []).append(f"'{key}'")
    return "; ".join(f"instead of {', '.join(names)} give {remedy}" for remedy, names in keys.items())


def _is_read(name: str, model: str) -> bool:
    """Whether OpenCV's coefficients describe a lens of this name."""
    if name == "distortionmodel":
        return LENSES_READ.fullmatch(_plain(model)) is not None
    return not OTHER_LENSES.search(_plain(model))


def _remedy(name: str, value: object) -> str | None:
    by_name = next((remedy for remedy, patterns in NAMES if any(re.fullmatch(one, name) for one in patterns)), None)
    return by_name or (f"{MATRIX}, or {EXTRINSIC}" if _is_matrix(value) else None)


def _says_nothing(value: object) -> bool:
    """Whether a value and everything in it is empty, zero or false, and so has no effect."""
    if isinstance(value, Mapping):
        return all(map(_says_nothing, value.values()))
    return value is None or (isinstance(value, bool | int | float | str | list) and not value)


def _is_matrix(value: object) -> bool:
    """Whether a value is a matrix of numbers, such as a camera matrix, a projection or a transform."""
    try:
        return np.array(value, dtype=np.float64).shape in {(3, 3), (3, 4), (4, 4)}
    except (TypeError, ValueError):
        return False


def _plain(name: object) -> str:
    return re.sub(r"[\W_]", "", str(name)).lower()
