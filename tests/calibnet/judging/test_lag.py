"""Late and early scans, by the motion that registering them tells; in the synthetic world, whose motion is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calibnet.datasets.frame import Frame
from calibnet.datasets.synthetic import KITTI_LIKE, SyntheticSequence
from calibnet.geometry import invert, transform_points
from calibnet.geometry.se3 import pose_from_vector
from calibnet.geometry.types import Extrinsic, Transform
from calibnet.judging.causes import cause
from calibnet.judging.lag import lags, reach_of
from calibnet.trace import CascadeTrace
from tests.support.drive import Drive
from tests.support.matches import LENS_ODDS, matches, run

DRIVE = SyntheticSequence(seed=4, length=4, rig=KITTI_LIKE)


@pytest.fixture(scope="module")
def frames() -> list[Frame]:
    return [DRIVE[position] for position in range(4)]


def motion(of: int, into: int) -> Transform:
    """From the LiDAR at one moment to the LiDAR at another."""
    poses = [DRIVE.world_from_vehicle(at) @ DRIVE.mount.vehicle_from_lidar for at in (of, into)]
    return invert(poses[1]) @ poses[0]


def late(frames: list[Frame], by: int) -> list[Frame]:
    """Images with the scan of a later moment."""
    return [replace(frames[at], points=frames[at + by].points) for at in range(max(0, -by), len(frames) - max(0, by))]


@pytest.mark.parametrize(("by", "word", "position"), [(1, "later", 1), (1, "later", 0), (-1, "earlier", 1)])
def test_a_lag_is_undone_by_the_motion_to_the_scan_beside(
    frames: list[Frame], by: int, word: str, position: int
) -> None:
    drive = late(frames, by)
    search = lags(drive, position)
    assert search is not None
    attempt = next(one for one in search.attempts if f"0.1 s {word}" in one.text)
    assert attempt.names == ("time-offset",)
    assert attempt.text.startswith(f"Scans seem 0.1 s {word} than their images: the car moves ")
    index = drive[position].index
    there = transform_points(motion(index + by, index), drive[position].points[:, :3].astype(np.float64))
    undone = attempt.undo(drive[position]).points[:, :3]
    assert np.linalg.norm(undone - there, axis=1).mean() < 0.1  # before it is a metre


def test_a_lag_is_the_cause_where_undoing_it_ends_near_the_guess(frames: list[Frame]) -> None:
    drive = late(frames, 1)
    search = lags(drive, 1)
    assert search is not None
    where = transform_points(motion(2, 1), drive[1].points[:, :3].astype(np.float64)).mean(axis=0)

    def calibrate(frame: Frame, initial: Extrinsic) -> CascadeTrace:
        """Ends as far from the guess as the scan lies from where it should be."""
        after = initial.copy()
        after[:3, 3] += initial[:3, :3] @ (where - frame.points[:, :3].mean(axis=0))
        return run(initial, after)

    found = cause(search, drive[1], drive[1].camera_from_lidar, reach_of(calibrate))
    assert [one.name for one in found] == ["time-offset"] and "0.1 s later" in found[0].text


@pytest.mark.parametrize(("focal", "measured"), [(1.0, 0.2), (0.96, np.inf)])
def test_no_lag_explains_matches_that_still_indicate_another_lens(
    frames: list[Frame], focal: float, measured: float
) -> None:
    initial = frames[0].camera_from_lidar
    after = pose_from_vector(np.array([0.1, 0, 0, 0, 0, 0])) @ initial  # a fifth of the range of stage 3, 0.5 m
    found = matches(np.eye(4), lambda places: focal * places, noise=0.5)
    measure = reach_of(lambda *_: run(initial, after, found), LENS_ODDS)
    assert measure(frames[0], initial) == pytest.approx(measured)


def test_without_neighbours_or_motion_there_is_nothing_to_try(frames: list[Frame]) -> None:
    assert lags([frames[0]], 0) is None
    assert lags([frames[0], frames[0]], 0) is None
    assert lags(Drive([0, 1]), 0) is None  # scans of one point
