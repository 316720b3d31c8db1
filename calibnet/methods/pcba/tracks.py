"""Points of the pictures, followed from frame to frame: Lucas-Kanade, begun where the scan says that they will be."""

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
"""Corners of a frame: the most, least strength relative to the strongest, and how far they stand apart."""
LONGEST, SHORTEST = 6, 3
"""Frames that a point is followed through, and the fewest."""
WINDOW_PX, LEVELS = 21, 3
RETURN_PX = 0.7
"""How far from where it began a point may end when it is followed back."""
DEPTH_PX = 4.0
"""Distance in the picture up to which a point of the scan gives a corner its depth."""


@dataclass(frozen=True, eq=False)
class Tracks:
    """Points that were followed.

    Attributes:
        landmark: ``[M]`` int, of each observation the number of its landmark.
        frame: ``[M]`` int, and the position of its frame.
        pixel: ``[M, 2]``, where it was seen.
        start: ``[N, 3]`` metres in the world frame, where each landmark would be by the depth of the scan there.
    """

    landmark: NDArray[np.int64] = field(repr=False)
    frame: NDArray[np.int64] = field(repr=False)
    pixel: Floats = field(repr=False)
    start: Floats = field(repr=False)

    def only(self, kept: NDArray[np.bool_]) -> Tracks:
        """Some of the landmarks, ``kept [N]``."""
        number = np.cumsum(kept) - 1
        seen = kept[self.landmark]
        return Tracks(number[self.landmark[seen]], self.frame[seen], self.pixel[seen], self.start[kept])


def follow(
    pictures: Sequence[NDArray[np.uint8]],
    scans: Sequence[NDArray[np.float32]],
    poses: Sequence[Transform],
    camera: PinholeCamera,
    camera_from_lidar: Extrinsic,
) -> Tracks:
    """Follow corners of grey pictures ``[H, W]`` through a drive.

    Args:
        pictures: one a frame.
        scans: likewise, ``[N, 4]``.
        poses: likewise, ``world_from_lidar``.
        camera: of all pictures.
        camera_from_lidar: where the camera is about: how far a point moves in the picture hardly depends on it.
    """
    landmarks: list[NDArray[np.int64]] = []
    frames: list[NDArray[np.int64]] = []
    pixels: list[Floats] = []
    starts: list[Floats] = []
    total = 0
    for first in range(len(pictures) - SHORTEST + 1):
        corners: Any = cv2.goodFeaturesToTrack(pictures[first], CORNERS, QUALITY, APART_PX)
        if corners is None:  # a picture without any
            continue
        begun = np.asarray(corners, np.float32).reshape(-1, 2)
        depth, known = depths(begun, scans[first], camera, camera_from_lidar)
        begun, depth = begun[known], depth[known]
        world = placed(begun, depth, camera, poses[first] @ invert(camera_from_lidar))
        seen, alive, now = [begun], np.ones(len(begun), bool), begun
        lengths = np.ones(len(begun), np.int64)
        for position in range(first + 1, min(first + LONGEST, len(pictures))):
            guess = _seen(world, camera, camera_from_lidar @ invert(poses[position])).astype(np.float32)
            if position > first + 1:  # the guess misses by about as much as it did in the frame before
                before = _seen(world, camera, camera_from_lidar @ invert(poses[position - 1])).astype(np.float32)
                guess += now - before
            now, ok = _followed(pictures[position - 1], pictures[position], now, guess)
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
    """Depth in metres that the scan has at pixels ``[N, 2]``, and whether it has any there."""
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
    """Where pixels ``[N, 2]`` at depths ``[N]`` are in the world, ``[N, 3]`` metres."""
    rays = np.column_stack([pixels, np.ones(len(pixels))]) @ np.linalg.inv(camera.matrix).T
    return np.asarray(transform_points(world_from_camera, rays * depth[:, None]))


def _seen(world: Floats, camera: PinholeCamera, camera_from_world: Transform) -> Floats:
    points = transform_points(camera_from_world, world)
    return np.asarray((points / np.maximum(points[:, 2:], 0.1)) @ camera.matrix[:2].T)


def _followed(
    one: NDArray[np.uint8], other: NDArray[np.uint8], pixels: NDArray[np.float32], guess: NDArray[np.float32]
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Where pixels of one picture are in another, and which of them come back when they are followed back."""
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
    """Where pixels of one picture are in another, begun at a guess, and whether they were found."""
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
