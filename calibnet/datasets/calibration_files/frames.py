"""Trees of coordinate frames, and the extrinsic between the frames of camera and LiDAR."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from calibnet.datasets.calibration_files.calibration_file import FrameChoice
from calibnet.errors import DatasetError
from calibnet.geometry import invert, transform
from calibnet.geometry.types import Extrinsic, Transform

OPTICAL = re.compile(r"optical", re.IGNORECASE)
CAMERA = re.compile(r"cam|optical|image|rgb", re.IGNORECASE)
LIDAR = re.compile(
    r"lidar|velo|laser|livox|ouster|os[_-]?(lidar|sensor|\d)|hesai|pandar|rslidar|robosense|scan", re.IGNORECASE
)
OPTICAL_FROM_BODY = transform([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]], [0.0, 0.0, 0.0])
"""From a body frame (x forward, y left, z up) to an optical one (x right, y down, z forward), as in REP 103."""
SAME = 1e-3
"""Largest difference between two paths to a frame, in metres and in elements of the rotation."""
UPRIGHT = 0.8
"""Cosine between the z axes of the camera's frame and the LiDAR's above which the former is not an optical frame."""


class Link(NamedTuple):
    """One frame in another: ``parent_from_child``, 4x4."""

    parent: str
    child: str
    parent_from_child: Transform


def camera_from_lidar(links: Iterable[Link], choice: FrameChoice, path: Path | str) -> Extrinsic:
    """The extrinsic between the camera's optical frame and the LiDAR's.

    Args:
        links: the tree of frames.
        choice: names of the frames; missing ones are recognised by their names.
        path: path of the file, for messages.

    Raises:
        DatasetError: a frame is missing, ambiguous, not connected, in two places, or not an optical frame.
    """
    tree: dict[str, dict[str, Transform]] = {}
    broken: list[str] = []
    for parent, child, parent_from_child in links:
        if not np.isfinite(parent_from_child).all():
            broken.append(child)  # ROS ignores it as well
            continue
        if not np.allclose(tree.get(parent, {}).get(child, parent_from_child), parent_from_child, atol=SAME):
            raise DatasetError(
                f"{path} has two different poses of {child} in {parent}; give the right one with --guess FILE."
            )
        tree.setdefault(parent, {})[child] = parent_from_child
        tree.setdefault(child, {})[parent] = invert(parent_from_child)
    if broken:
        path = f"{path}, without {', '.join(broken[:5])} (a quaternion of length 0, or a number that is not finite),"
    lidar = _chosen(tree, choice.lidar, LIDAR, "lidar", path)
    reachable = _from(tree, lidar, path)
    near = {name: tree[name] for name in reachable}
    is_near = choice.camera is None and any(CAMERA.search(name) for name in near if name != lidar)
    camera = _chosen(near if is_near else tree, choice.camera, CAMERA, "camera", path, but=lidar)
    if camera not in reachable:
        raise DatasetError(f"{path} does not connect {camera} with {lidar}; give the transforms between them.")
    found = invert(reachable[camera])
    if found[2, 2] > UPRIGHT and not OPTICAL.search(camera):
        raise DatasetError(
            f"{path}: the frame {camera} has its z axis up like the LiDAR, so it is not the camera's optical frame; "
            "give that (x right, y down, z forward) with --camera-frame, and add it if it is missing."
        )
    return found


def _from(tree: dict[str, dict[str, Transform]], start: str, path: Path | str) -> dict[str, Transform]:
    """``start_from_frame`` of every connected frame.

    Raises:
        DatasetError: two paths to a frame contradict each other.
    """
    found, waiting = {start: np.eye(4)}, [start]
    while waiting:
        frame = waiting.pop()
        for other, frame_from_other in tree[frame].items():
            by_this_way = found[frame] @ frame_from_other
            if other not in found:
                found[other] = by_this_way
                waiting.append(other)
            elif not np.allclose(found[other], by_this_way, atol=SAME):
                raise DatasetError(
                    f"{path} has two paths from {start} to {other} that contradict each other; a frame has only "
                    "one parent, so remove the wrong transform."
                )
    return found


def _chosen(
    tree: dict[str, dict[str, Transform]],
    name: str | None,
    pattern: re.Pattern[str],
    what: str,
    path: Path | str,
    but: str = "",
) -> str:
    """The frame of a name, or the only one whose name is that of such a frame."""
    if name is not None:
        if name not in tree:
            there = ", ".join(sorted(tree)) or "none"
            raise DatasetError(
                f"{path} has no frame {name!r}; choose one of {there} with --{what}-frame, or give a "
                "first guess with --guess FILE."
            )
        return name
    called = [frame for frame in tree if pattern.search(frame) and frame != but]
    for better in (OPTICAL.search, lambda frame: not re.search(r"base|mount|plate|imu", frame)):
        called = [frame for frame in called if better(frame)] or called
    if what == "camera":
        called = [frame for frame in called if not LIDAR.search(frame)] or called
    if len(called) != 1:
        found = f"several frames of a {what} ({', '.join(called[:6])})" if called else (
            f"no frame with the name of a {what} ({', '.join(sorted(tree)[:8])})"
        )  # fmt: skip
        raise DatasetError(f"{path} has {found}; name it with --{what}-frame.")
    return called[0]
