"""Scans that are later or earlier than their pictures: told by how the car moved from one scan to the next.

A late scan shows the world from where the car is by then. Matches explain that by a camera farther back, and fit.
Nothing in one frame contradicts them; but put back by the car's own motion, which registering two scans tells, the same
scan is found where the guess says.
"""

from __future__ import annotations

import os

import numpy as np
from numpy.typing import NDArray

from calibnet.datasets.frame import Frames
from calibnet.errors import DatasetError
from calibnet.geometry.se3 import invert, pose_from_vector, pose_vector
from calibnet.geometry.types import Transform
from calibnet.judging.causes import Attempt, Search, scan_moved

Points = NDArray[np.float32] | NDArray[np.float64]

VOXEL_M = 0.5
"""Side of the cells in which points are averaged before scans are registered."""
FARTHEST_M = 3.0
"""Between points that are taken for the same: the car moves that far from scan to scan at 100 km/h."""
FEWEST_POINTS = 500
"""That have to agree for a registration to be believed."""
STANDING_M = 0.1
"""Motion below which a lag makes no difference."""
SHARES = (1.0, 0.5)
"""Lags that are tried, as shares of the time between two scans."""
SHARE, MOST = 0.5, 1.0
"""See `calibnet.judging.causes.Search`: the result then lies in the range searched, half as far from the guess."""


def lags(frames: Frames, position: int) -> Search | None:
    """What undoes a lag of the scan at a position of a drive, by the motion to the scans before and after it.

    Args:
        frames: of the drive, in the order in which they were taken.
        position: of the frame.

    Returns:
        Attempts, to be judged by `calibnet.judging.causes.reach_of`; None where there is no neighbour, or no motion.
    """
    beside = {step: _motion(frames, position, step) for step in (-1, 1)}
    attempts: list[Attempt] = []
    for step, word in ((-1, "later"), (1, "earlier")):
        motion, seconds = beside[step] or _backwards(beside[-step])
        if motion is not None and np.linalg.norm(motion[:3, 3]) >= STANDING_M:
            attempts += [_attempt(motion, share, seconds, word) for share in SHARES]
    return Search(tuple(attempts), SHARE, MOST, "of the range from the guess") if attempts else None


Motion = tuple[Transform | None, float]
"""From one scan to another, and the seconds between them."""


def _motion(frames: Frames, position: int, step: int) -> Motion | None:
    """From the scan at a position to the one so many further; None where there is none, or none that fits."""
    if not 0 <= position + step < len(frames):
        return None
    try:
        here, there = frames[position], frames[position + step]
    except DatasetError:  # of what cannot be read nothing can be learnt
        return None
    motion = registered(here.points, there.points)
    return None if motion is None else (motion, abs(there.timestamp - here.timestamp))


def _backwards(motion: Motion | None) -> Motion:
    """The motion to the scan on the other side, if the car goes on as it does."""
    if motion is None or motion[0] is None:
        return None, 0.0
    return invert(motion[0]), motion[1]


def _attempt(motion: Transform, share: float, seconds: float, word: str) -> Attempt:
    moved = pose_from_vector(share * pose_vector(motion))
    by = f"{share * seconds:.2g} s" if seconds > 0 else f"{share:g} of a frame"
    text = (
        f"Scans seem {by} {word} than their pictures: the car moves {np.linalg.norm(moved[:3, 3]):.1f} m in that time."
    )
    return Attempt(("time-offset",), text, scan_moved(moved))


def registered(points: Points, onto: Points) -> Transform | None:
    """The motion that takes one scan onto another, 4x4: points of the first as the LiDAR saw them at the second.

    Args:
        points: ``[N, 3 or more]`` metres.
        onto: ``[M, 3 or more]`` likewise.

    Returns:
        None where too few points agree.
    """
    import small_gicp

    result = small_gicp.align(
        np.asarray(onto[:, :3], np.float64),
        np.asarray(points[:, :3], np.float64),
        registration_type="GICP",
        downsampling_resolution=VOXEL_M,
        max_correspondence_distance=FARTHEST_M,
        num_threads=os.cpu_count() or 1,
    )
    if not result.converged or result.num_inliers < FEWEST_POINTS:
        return None
    return np.asarray(result.T_target_source, np.float64)
