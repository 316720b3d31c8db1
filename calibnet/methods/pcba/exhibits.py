"""Exhibits of a frame of an adjusted drive: its tracks, and the planes in front of the camera."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from calibnet.exhibit import Exhibit
from calibnet.geometry.se3 import invert, transform_points
from calibnet.geometry.types import Transform
from calibnet.methods.pcba.adjustment import Adjusted
from calibnet.methods.pcba.planes import Planes
from calibnet.methods.pcba.tracks import Tracks

WIDTH = 960
"""Width of the exhibits in pixels."""
FARTHEST_M = 40.0
BAD_PX = 3.0
"""Reprojection error, in pixels, at which a landmark is fully red."""


def exhibits(
    image: NDArray[np.uint8], position: int, tracks: Tracks, found: Adjusted, planes: Planes, pose: Transform
) -> tuple[Exhibit, ...]:
    """The two exhibits of a frame.

    Args:
        image: grey image, ``[H, W]``.
        position: position of the frame in the drive.
        tracks: tracks of the drive.
        found: result of the adjustment.
        planes: planes of the drive's map.
        pose: ``world_from_lidar`` of the frame.
    """
    return (
        Exhibit("Tracks, green where the landmark is seen there", _tracked(image, position, tracks, found)),
        Exhibit("Planes of the scans, coloured by their normals", _planes(image, found, planes, pose)),
    )


def _small(image: NDArray[np.uint8]) -> tuple[NDArray[np.uint8], float]:
    scale = min(1.0, WIDTH / image.shape[1])
    small = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    return np.repeat((small * 0.7).astype(np.uint8)[..., None], 3, axis=2), scale


def _tracked(image: NDArray[np.uint8], position: int, tracks: Tracks, found: Adjusted) -> NDArray[np.uint8]:
    canvas, scale = _small(image)
    here = np.flatnonzero(tracks.frame == position)
    for row in here:
        same = np.flatnonzero(tracks.landmark == tracks.landmark[row])
        trail = np.rint(scale * tracks.pixel[same[np.argsort(tracks.frame[same])]]).astype(np.int32)
        level = float(np.clip(found.reprojection[row] / BAD_PX, 0, 1))
        color = (int(255 * level), int(255 * (1 - level)), 60)
        cv2.polylines(canvas, [trail], False, color, 1, cv2.LINE_AA)
        u, v = np.rint(scale * tracks.pixel[row]).astype(int).tolist()
        cv2.circle(canvas, (u, v), 2, color, -1, cv2.LINE_AA)
    return canvas


def _planes(image: NDArray[np.uint8], found: Adjusted, planes: Planes, pose: Transform) -> NDArray[np.uint8]:
    canvas, scale = _small(image)
    camera_from_world = found.camera_from_lidar @ invert(pose)
    points = transform_points(camera_from_world, planes.points)
    ahead = np.flatnonzero((points[:, 2] > 1.0) & (points[:, 2] < FARTHEST_M))
    ahead = ahead[np.argsort(-points[ahead, 2])]
    pixel = np.rint(scale * (points[ahead] / points[ahead, 2:]) @ found.camera.matrix[:2].T).astype(np.int64)
    inside = ((pixel >= 0) & (pixel < [canvas.shape[1], canvas.shape[0]])).all(axis=1)
    colors = (255 * np.abs(planes.normals[ahead[inside]])).astype(np.uint8)
    canvas[pixel[inside, 1], pixel[inside, 0]] = colors
    return canvas
