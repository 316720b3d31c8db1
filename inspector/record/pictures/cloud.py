"""The scan as a cloud in 3D: the points that are shown, and their colours from the image."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from calibnet.datasets.frame import Frame
from calibnet.geometry import project_through
from calibnet.geometry.types import Extrinsic
from inspector.record.observation import Observation

SEEN_SHARE = 0.8
"""Share of the shown points that the camera sees."""
OUTSIDE = (70, 72, 80)
"""Colour of points that the camera does not see."""
RANGE_M = 80.0
"""Largest distance of shown points from the LiDAR, in metres."""


def subsample(observation: Observation, limit: int) -> NDArray[np.float32]:
    """At most ``limit`` points ``[M, 4]`` of the scan, most of which the camera sees before or after the correction."""
    frame = observation.frame
    near = np.square(frame.points[:, :3]).sum(axis=1) < RANGE_M**2
    seen = np.zeros(len(frame.points), dtype=np.bool_)
    for camera_from_lidar in (observation.trace.initial, observation.trace.corrected):
        seen[observation.projected(camera_from_lidar).index] = True
    parts = [
        _evenly(np.flatnonzero(near & seen), round(SEEN_SHARE * limit)),
        _evenly(np.flatnonzero(near & ~seen), round((1.0 - SEEN_SHARE) * limit)),
    ]
    return frame.points[np.concatenate(parts)]


def seen_colors(frame: Frame, points: NDArray[np.float32], camera_from_lidar: Extrinsic) -> NDArray[np.uint8]:
    """``[M, 3]`` RGB: the colour of the pixel that each point projects to, or grey outside the image."""
    image, camera = frame.as_taken
    projection = project_through(points, camera_from_lidar, camera)
    rgb = np.full((len(points), 3), OUTSIDE, dtype=np.uint8)
    u, v = np.rint(projection.pixels).astype(np.intp).T
    height, width = image.shape[:2]
    rgb[projection.index] = image[np.minimum(v, height - 1), np.minimum(u, width - 1)]
    return rgb


def _evenly(rows: NDArray[np.intp], limit: int) -> NDArray[np.intp]:
    """At most ``limit`` evenly spaced rows."""
    return rows[:: max(1, -(-len(rows) // limit))]
