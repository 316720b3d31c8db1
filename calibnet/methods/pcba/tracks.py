"""Tracks points from image to image by Lucas-Kanade, starting from where the scan's depth predicts them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from calibnet.geometry import PinholeCamera
from calibnet.geometry.se3 import invert, transform_points
from calibnet.geometry.types import Extrinsic, Floats, Transform

CORNERS, QUALITY, APART_PX = 500, 0.01, 12
"""Corners of a frame: largest number, smallest strength relative to the strongest, and smallest distance."""
LONGEST, SHORTEST = 6, 3
"""Largest and smallest number of frames of a track."""
WINDOW_PX, LEVELS = 21, 3
RETURN_PX = 0.7
"""Largest distance from its start at which a point may arrive when it is tracked back."""
DEPTH_PX = 4.0
"""Largest distance, in pixels, of the scan's point that gives a corner its depth."""


@dataclass(frozen=True, eq=False)
class Tracks:
    """M observations of N landmarks.

    Attributes:
        landmark: ``[M]`` int, number of the landmark of each observation.
        frame: ``[M]`` int, position of its frame.
        pixel: ``[M, 2]``, pixel where the landmark was seen.
        start: ``[N, 3]`` metres in the world frame, initial landmarks by the depth of the scan.
    """

    landmark: NDArray[np.int64] = field(repr=False)
    frame: NDArray[np.int64] = field(repr=False)
    pixel: Floats = field(repr=False)
    start: Floats = field(repr=False)

    def only(self, kept: NDArray[np.bool_]) -> Tracks:
        """The tracks of some landmarks, ``kept [N]``."""
        number = np.cumsum(kept) - 1
        seen = kept[self.landmark]
        return Tracks(number[self.landmark[seen]], self.frame[seen], self.pixel[seen], self.start[kept])


def follow(
    images: Sequence[NDArray[np.uint8]],
    scans: Sequence[NDArray[np.float32]],
    poses: Sequence[Transform],
    camera: PinholeCamera,
    camera_from_lidar: Extrinsic,
) -> Tracks:
    """Track corners of grey images ``[H, W]`` through a drive.

    Args:
        images: image of each frame.
        scans: scan of each frame, ``[N, 4]``.
        poses: ``world_from_lidar`` of each frame.
        camera: camera of all images.
        camera_from_lidar: approximate extrinsic, on which the motion of points in the image hardly depends.
    """
    landmarks: list[NDArray[np.int64]] = []
    frames: list[NDArray[np.int64]] = []
    pixels: list[Floats] = []
    starts: list[Floats] = []
    total = 0
    for first in range(len(images) - SHORTEST + 1):
        corners: Any = cv2.goodFeaturesToTrack(images[first], CORNERS, QUALITY, APART_PX)
        if corners is None:  # an image without corners
            continue
        begun = np.asarray(corners, np.float32).reshape(-1, 2)
        depth, known = depths(begun, scans[first], camera, camera_from_lidar)
        begun, depth = begun[known], depth[known]
        world = placed(begun, depth, camera, poses[first] @ invert(camera_from_lidar))
        seen, alive, now = [begun], np.ones(len(begun), bool), begun
        lengths = np.ones(len(begun), np.int64)
        for position in range(first + 1, min(first + LONGEST, len(images))):
            guess = _seen(world, camera, camera_from_lidar @ invert(poses[position])).astype(np.float32)
            if position > first + 1:  # the guess is off by about as much as in the frame before
                before = _seen(world, camera, camera_from_lidar @ invert(poses[position - 1])).astype(np.float32)
                guess += now - before
            now, ok = _followed(images[position - 1], images[position], now, guess)
            alive &= ok
            lengths += alive
            seen.append(now)
        kept = np.flatnonzero(lengths >= SHORTEST)
        for step, at in enumerate(seen):
            rows = kept[lengths[kept] > step]
            numbers = total + np.searchsorted(kept, rows)
            landmarks.append(numbers)
            frames.append(np.full(len(rows), first + step))
            pixels.append(at[rows].astype(np.float64))
        starts.append(world[kept])
        total += len(kept)
    if not starts:
        return Tracks(np.empty(0, np.int64), np.empty(0, np.int64), np.empty((0, 2)), np.empty((0, 3)))
    return Tracks(np.concatenate(landmarks), np.concatenate(frames), np.concatenate(pixels), np.concatenate(starts))


def depths(
    pixels: NDArray[np.float32], scan: NDArray[np.float32], camera: PinholeCamera, camera_from_lidar: Extrinsic
) -> tuple[Floats, NDArray[np.bool_]]:
    """Depth of the scan in metres at pixels ``[N, 2]``, and whether there is any."""
    from scipy.spatial import cKDTree

    points = transform_points(camera_from_lidar, scan[:, :3].astype(np.float64))
    points = points[points[:, 2] > 1.0]
    at = (points / points[:, 2:]) @ camera.matrix[:2].T
    inside = (np.abs(at - [camera.width / 2, camera.height / 2]) < [camera.width, camera.height]).all(axis=1)
    at, points = at[inside], points[inside]
    if not len(at):
        return np.zeros(len(pixels)), np.zeros(len(pixels), bool)
    distance, row = cKDTree(at).query(pixels, distance_upper_bound=DEPTH_PX)
    known = np.isfinite(distance)
    return np.where(known, points[np.where(known, row, 0), 2], 0.0), known


def placed(pixels: NDArray[np.float32], depth: Floats, camera: PinholeCamera, world_from_camera: Transform) -> Floats:
    """Back-project pixels ``[N, 2]`` at depths ``[N]`` to the world frame, ``[N, 3]`` metres."""
    rays = np.column_stack([pixels, np.ones(len(pixels))]) @ np.linalg.inv(camera.matrix).T
    return np.asarray(transform_points(world_from_camera, rays * depth[:, None]))


def _seen(world: Floats, camera: PinholeCamera, camera_from_world: Transform) -> Floats:
    points = transform_points(camera_from_world, world)
    return np.asarray((points / np.maximum(points[:, 2:], 0.1)) @ camera.matrix[:2].T)


def _followed(
    one: NDArray[np.uint8], other: NDArray[np.uint8], pixels: NDArray[np.float32], guess: NDArray[np.float32]
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Positions of pixels of one image in another, and whether they return when they are tracked back."""
    if not len(pixels):
        return pixels, np.zeros(0, bool)
    there, ok = _moved(one, other, pixels, guess)
    back, ok_back = _moved(other, one, there, pixels)
    returned = np.linalg.norm(back - pixels, axis=1) < RETURN_PX
    inside = ((there >= 0) & (there < [one.shape[1], one.shape[0]])).all(axis=1)
    return there, ok & ok_back & returned & inside


def _moved(
    one: NDArray[np.uint8], other: NDArray[np.uint8], pixels: NDArray[np.float32], guess: NDArray[np.float32]
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Positions of pixels of one image in another, searched from a guess, and whether they were found."""
    there, ok, _ = cv2.calcOpticalFlowPyrLK(
        one,
        other,
        pixels.reshape(-1, 1, 2),
        guess.reshape(-1, 1, 2).copy(),
        winSize=(WINDOW_PX, WINDOW_PX),
        maxLevel=LEVELS,
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
    )
    return np.asarray(there, np.float32).reshape(-1, 2), np.asarray(ok).ravel() == 1
