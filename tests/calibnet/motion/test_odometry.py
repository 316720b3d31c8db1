"""The motion of the LiDAR from scan to scan, in the synthetic world, whose car's motion is known."""

from __future__ import annotations

import numpy as np
import pytest

from calibnet.datasets.frame import Frame
from calibnet.datasets.synthetic import KITTI_LIKE, SyntheticSequence
from calibnet.geometry import invert, pose_error
from calibnet.geometry.types import Transform
from calibnet.motion.odometry import above_ground, motion_between, registered

DRIVE = SyntheticSequence(seed=4, length=3, rig=KITTI_LIKE)


@pytest.fixture(scope="module")
def frames() -> list[Frame]:
    return [DRIVE[position] for position in range(3)]


def motion(of: int, into: int) -> Transform:
    """From the LiDAR at one moment to the LiDAR at another."""
    poses = [DRIVE.world_from_vehicle(at) @ DRIVE.mount.vehicle_from_lidar for at in (of, into)]
    return invert(poses[1]) @ poses[0]


def test_the_motion_between_two_scans_is_that_of_the_car(frames: list[Frame]) -> None:
    found = registered(frames[1].points, frames[0].points)
    assert found is not None
    truth = motion(1, 0)
    assert truth[0, 3] > 0.7  # the car drives on
    error = pose_error(found, truth)
    assert error.rotation_deg < 0.2 and error.translation_cm < 6
    assert registered(frames[1].points[:300], frames[0].points[:300]) is None


def test_the_fine_motion_is_right_to_the_centimetre(frames: list[Frame]) -> None:
    for position in (0, 1):
        found = motion_between(frames[position].points, frames[position + 1].points)
        assert found is not None
        error = pose_error(found, motion(position, position + 1))
        assert error.rotation_deg < 0.06 and error.translation_cm < 1.5
    assert motion_between(frames[0].points[:300], frames[1].points[:300]) is None


def test_the_ground_is_left_out() -> None:
    generator = np.random.default_rng(0)
    ground = np.column_stack([generator.uniform(-20, 20, (5000, 2)), np.full(5000, -1.7)])
    ground[:, 2] += 0.05 * ground[:, 0]  # a slope of 5 %
    wall = np.column_stack([np.full(500, 10.0), generator.uniform(-5, 5, 500), generator.uniform(0, 3, 500)])
    kept = above_ground(np.concatenate([ground, wall]))
    assert {tuple(point) for point in kept} == {tuple(point) for point in wall}
    assert not len(above_ground(np.empty((0, 3))))
