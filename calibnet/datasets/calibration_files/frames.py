"""Coordinate frames that hang on each other, and which of them are the camera's and the LiDAR's."""

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
"""From a frame with x forward, y left, z up to one with x right, y down, z forward: REP 103."""
UPRIGHT = 0.8
"""Cosine between the z axes of a camera's frame and the LiDAR's from which on the camera's is none of an image."""


class Link(NamedTuple):
    """One frame in another: ``parent_from_child``, 4x4."""

    parent: str
    child: str
    parent_from_child: Transform


def camera_from_lidar(links: Iterable[Link], choice: FrameChoice, path: Path | str) -> Extrinsic:
    """The extrinsic between the camera's optical frame and the LiDAR's.

    Args:
        links: the tree of frames.
        choice: their names; those that are not given are found by what they are called.
        path: of the file, for messages.

    Raises:
        DatasetError: a frame is not there, could be one of several, hangs on another tree, or is not an image's.
    """
    tree: dict[str, dict[str, Transform]] = {}
    for parent, child, parent_from_child in links:
        tree.setdefault(parent, {})[child] = parent_from_child
        tree.setdefault(child, {})[parent] = invert(parent_from_child)
    lidar = _chosen(tree, choice.lidar, LIDAR, "lidar", path)
    reachable = _from(tree, lidar)
    cameras = {name: tree[name] for name in tree if choice.camera is not None or name in reachable}
    camera = _chosen(cameras, choice.camera, CAMERA, "camera", path, but=lidar)
    if camera not in reachable:
        raise DatasetError(f"{path} does not connect {camera} with {lidar}; give the transforms between them.")
    found = invert(reachable[camera])
    if found[2, 2] > UPRIGHT and not OPTICAL.search(camera):
        raise DatasetError(
            f"{path}: the frame {camera} stands as the LiDAR does, x forward and z up, so it is not that of the image; "
            "name its optical frame (x right, y down, z forward) with --camera-frame, and add that if it is missing."
        )
    return found


def _from(tree: dict[str, dict[str, Transform]], start: str) -> dict[str, Transform]:
    """``start_from_frame`` of every frame that hangs on it."""
    found, waiting = {start: np.eye(4)}, [start]
    while waiting:
        frame = waiting.pop()
        for other, frame_from_other in tree[frame].items():
            if other not in found:
                found[other] = found[frame] @ frame_from_other
                waiting.append(other)
    return found


def _chosen(
    tree: dict[str, dict[str, Transform]],
    name: str | None,
    pattern: re.Pattern[str],
    what: str,
    path: Path | str,
    but: str = "",
) -> str:
    """The frame of that name, or the only one that is called as such frames are."""
    if name is not None:
        if name not in tree:
            raise DatasetError(f"{path} has no frame {name!r}; frames there: {', '.join(sorted(tree)) or 'none'}.")
        return name
    called = [frame for frame in tree if pattern.search(frame) and frame != but]
    for better in (OPTICAL.search, lambda frame: not re.search(r"base|mount|plate|imu", frame)):
        called = [frame for frame in called if better(frame)] or called
    if what == "camera":
        called = [frame for frame in called if not LIDAR.search(frame)] or called
    if len(called) != 1:
        found = f"several frames of a {what} ({', '.join(called[:6])})" if called else (
            f"no frame that is called like a {what} ({', '.join(sorted(tree)[:8])})"
        )  # fmt: skip
        raise DatasetError(f"{path} has {found}; name it with --{what}-frame.")
    return called[0]
