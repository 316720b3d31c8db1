"""Lists of transforms between frames: ``/tf_static`` as printed by ``topic echo`` or by hand, and Autoware's files."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from calibnet.datasets.calibration_files import values
from calibnet.datasets.calibration_files.calibration_file import CalibrationFile, Wanted
from calibnet.datasets.calibration_files.frames import OPTICAL_FROM_BODY, Link, camera_from_lidar
from calibnet.errors import DatasetError
from calibnet.geometry import invert, transform

AXES = ("x", "y", "z", "roll", "pitch", "yaw")
PARENTS = ("parent", "parent_frame", "frame_id", "parent_frame_id")
CHILDREN = ("child", "child_frame", "child_frame_id")


def is_list(content: Any) -> bool:
    """Whether the content is a list of transforms."""
    items = _items(content)
    return bool(items) and all(isinstance(item, Mapping) and any(key in item for key in CHILDREN) for item in items)


def read_list(content: Any, path: Path, wanted: Wanted) -> CalibrationFile:
    """The extrinsic from a list of ``parent``, ``child``, ``translation`` and ``rotation``, or ``transform``.

    A quaternion needs the keys x, y, z, w; four numbers without names are refused.

    Raises:
        DatasetError: an item is malformed, or the frames do not connect the LiDAR with the camera.
    """
    links = [_link(item, number, path) for number, item in enumerate(_items(content), start=1)]
    return CalibrationFile("a list of transforms", None, camera_from_lidar(links, wanted.frames, path))


def is_autoware(content: Any) -> bool:
    """Whether the content is of Autoware's ``sensors_calibration.yaml`` or ``sensor_kit_calibration.yaml``."""
    if not isinstance(content, Mapping) or not content:
        return False
    children = [child for parent in content.values() if isinstance(parent, Mapping) for child in parent.values()]
    mappings = all(isinstance(parent, Mapping) for parent in content.values())
    return mappings and bool(children) and all(isinstance(one, Mapping) and set(AXES) <= set(one) for one in children)


def read_autoware(content: Mapping[Any, Any], path: Path, wanted: Wanted) -> CalibrationFile:
    """The extrinsic from nested frames, each with x, y, z in metres and roll, pitch, yaw in radians.

    Autoware's camera frames are body frames (x forward); the optical frame ``..._optical_link`` is their child, by the
    rotation in Autoware's vehicle descriptions.
    """
    links = []
    for parent, children in content.items():
        for child, numbers in children.items():
            key = f"{parent}.{child}"
            x, y, z, *angles = values.numbers([numbers[axis] for axis in AXES], key, path, (6,))
            parent_from_child = transform(values.roll_pitch_yaw(np.array(angles)), [x, y, z])
            links.append(Link(str(parent), str(child), parent_from_child))
            if str(child).endswith("camera_link"):
                optical = str(child).removesuffix("link") + "optical_link"
                links.append(Link(str(child), optical, invert(OPTICAL_FROM_BODY)))
    return CalibrationFile("Autoware's calibration", None, camera_from_lidar(links, wanted.frames, path))


def _items(content: Any) -> list[Any]:
    if isinstance(content, Mapping) and isinstance(content.get("transforms"), list):
        content = content["transforms"]
    if isinstance(content, Mapping) and any(key in content for key in CHILDREN):
        return [content]  # a single message, as in Apollo's files
    return content if isinstance(content, list) else []


def _link(item: Mapping[Any, Any], number: int, path: Path) -> Link:
    where = f"transform {number}"
    header = item.get("header")
    parent = next((item[key] for key in PARENTS if key in item), None)
    if parent is None and isinstance(header, Mapping):
        parent = header.get("frame_id")
    child = next(item[key] for key in CHILDREN if key in item)
    if parent is None:
        raise DatasetError(f"Calibration {path}: {where} has no parent frame; give 'parent'.")
    given = item["transform"] if isinstance(item.get("transform"), Mapping) else item
    parts = dict(_parts(given))
    if not parts:
        raise DatasetError(f"Calibration {path}: {where} has no translation and rotation; give both.")
    return Link(str(parent).lstrip("/"), str(child).lstrip("/"), values.pose(parts, path, where))


def _parts(given: Mapping[Any, Any]) -> Iterator[tuple[str, Any]]:
    """Translation and rotation under the names that `calibnet.datasets.calibration_files.values.pose` reads."""
    if set("xyz") <= set(given):
        yield "translation", [given[axis] for axis in "xyz"]
    spelled = values.spelled_out(given)
    yield from ((key, spelled[key]) for key in ("translation", *values.ROTATIONS) if spelled.get(key) is not None)
    for names, key in ((("qx", "qy", "qz", "qw"), "quaternion_xyzw"), (("roll", "pitch", "yaw"), "rpy_rad")):
        if set(names) <= set(given):
            yield key, [given[name] for name in names]
