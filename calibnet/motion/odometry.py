"""LiDAR odometry: every scan of a drive is registered onto those before it."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from calibnet.geometry.se3 import invert, pose_vector, transform_points
from calibnet.geometry.types import Transform
from calibnet.runtime.threads import cores

BEFORE = 5
"""Number of earlier scans that the next one is registered onto. With a single one, rings on the road attract each other
and the path is too short: by 3.5 % in the synthetic world, with this number by less than 0.1 %."""
POINT_M, VOXEL_M = 0.25, 1.0
"""Sides of the voxels in which points are averaged, and of those whose points form a Gaussian to register onto."""
FARTHEST_M = 2.0
"""Largest distance between corresponding points once the motion is known roughly."""
ROUGH_M, ROUGH_FARTHEST_M = 0.5, 3.0
"""The same two before: at 100 km/h the car moves the second length from scan to scan."""
CELL_M, GROUND_M = 2.0, 0.3
"""Side of the cells whose lowest point is on the ground, and height up to which points are taken for ground."""
FEWEST_POINTS = 500
"""Fewest inliers of a registration that is trusted."""


Points = NDArray[np.float32] | NDArray[np.float64]


def registered(points: Points, onto: Points) -> Transform | None:
    """Register one scan onto another: the transform 4x4 of points of the first into the LiDAR's frame at the second.

    Args:
        points: ``[N, 3 or more]`` metres.
        onto: ``[M, 3 or more]`` likewise.

    Returns:
        None if too few points correspond.
    """
    import small_gicp

    result = small_gicp.align(
        np.asarray(onto[:, :3], np.float64),
        np.asarray(points[:, :3], np.float64),
        registration_type="GICP",
        downsampling_resolution=ROUGH_M,
        max_correspondence_distance=ROUGH_FARTHEST_M,
        num_threads=cores(),
    )
    if not result.converged or result.num_inliers < FEWEST_POINTS:
        return None
    return np.asarray(result.T_target_source, np.float64)


def motion_between(scan: Points, following: Points) -> Transform | None:
    """The transform 4x4 of points of a scan into the LiDAR's frame at the following scan; None if it is not found.

    How far the car drives is registered without the ground, whose rings attract each other: in the synthetic world the
    way is then 0.2 % too long instead of 2 % too short. The ground determines roll, pitch and height.
    """
    back = registered(following, scan)
    if back is not None:
        back = _onto(following, [scan], [np.eye(4)], back)
    level = None if back is None else _onto(above_ground(following), [above_ground(scan)], [np.eye(4)], back)
    if back is None or level is None:
        return None
    back[:2, 3] = level[:2, 3]
    return invert(back)


def above_ground(scan: Points) -> Points:
    """The points of a scan that lie above the lowest ones around them."""
    _, cell = np.unique(np.floor(scan[:, :2] / CELL_M).astype(np.int64), axis=0, return_inverse=True)
    lowest = np.full(int(cell.max(initial=0)) + 1, np.inf)
    np.minimum.at(lowest, cell, scan[:, 2])
    return scan[scan[:, 2] > lowest[cell] + GROUND_M]


def longest_run(scans: Sequence[NDArray[np.float32]]) -> tuple[int, list[Transform]]:
    """The longest run of scans ``[N, 4]`` that can be registered one after the other.

    Each registration starts from the motion before it (constant velocity).

    Returns:
        The position of its first scan, and ``world_from_lidar`` of each, 4x4; the first is the identity.
    """
    runs: list[tuple[int, list[Transform]]] = [(0, [np.eye(4)])] if len(scans) else []
    motion: Transform | None = None
    for position in range(1, len(scans)):
        first, poses = runs[-1]
        if motion is None:
            motion = registered(scans[position], scans[position - 1])
        if motion is not None:
            past = range(max(first, position - BEFORE), position)
            motion = _onto(scans[position], [scans[one] for one in past], [poses[one - first] for one in past], motion)
        if motion is None:
            runs.append((position, [np.eye(4)]))
        else:
            poses.append(poses[-1] @ motion)
    return max(runs, key=lambda run: len(run[1]), default=(0, []))


def path(poses: Sequence[Transform]) -> tuple[float, float]:
    """Distance driven in metres, and the sum of all rotations in degrees."""
    steps = [pose_vector(invert(a) @ b) for a, b in itertools.pairwise(poses)]
    metres = sum(float(np.linalg.norm(step[:3])) for step in steps)
    return metres, float(np.degrees(sum(float(np.linalg.norm(step[3:])) for step in steps)))


def _onto(scan: Points, past: Sequence[Points], poses: Sequence[Transform], motion: Transform) -> Transform | None:
    """The motion from the last of some scans to the next one; None if registration fails."""
    import small_gicp

    target = [transform_points(invert(poses[-1]) @ pose, one[:, :3]) for one, pose in zip(past, poses, strict=True)]
    result = small_gicp.align(
        np.concatenate(target).astype(np.float64),
        scan[:, :3].astype(np.float64),
        init_T_target_source=motion,
        registration_type="VGICP",
        voxel_resolution=VOXEL_M,
        downsampling_resolution=POINT_M,
        max_correspondence_distance=FARTHEST_M,
        num_threads=1,
    )
    believed = result.converged and result.num_inliers >= FEWEST_POINTS
    return np.asarray(result.T_target_source, np.float64) if believed else None
