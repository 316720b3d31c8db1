"""The extrinsic from the motion of a synthetic car, whose mount is known exactly."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from calibnet.datasets.frame import Frame
from calibnet.datasets.synthetic import KITTI_LIKE, SyntheticSequence
from calibnet.geometry import PinholeCamera, miscalibration, pose_error
from calibnet.motion import MotionPairs, motion_estimate
from calibnet.motion.estimate import FEWEST_PAIRS
from calibnet.trace.drives import CONTRADICTION

LENGTH = 6


@pytest.fixture(scope="module")
def frames() -> list[Frame]:
    drive = SyntheticSequence(seed=4, length=LENGTH, rig=KITTI_LIKE)
    return [drive[position] for position in range(LENGTH)]


def paired(frames: list[Frame], extrinsic: np.ndarray) -> MotionPairs:
    pairs = MotionPairs(extrinsic)
    for one, other in itertools.pairwise(frames):
        pairs.add(one, other)
    return pairs


def test_the_mount_is_found_from_the_motion(frames: list[Frame]) -> None:
    reference = frames[0].camera_from_lidar
    start = miscalibration([0.2, -0.2, 0.2], [0.05, -0.05, 0.05]) @ reference
    found = motion_estimate(paired(frames, start), start)
    assert found is not None and found.frames == LENGTH - 1 and found.tracks > 500
    assert found.moved_m == pytest.approx(LENGTH - 1, rel=0.1)
    error = pose_error(found.camera_from_lidar, reference)
    assert error.rotation_deg < 0.4 and error.translation_cm < 15
    assert found.distance(replace(found, camera_from_lidar=reference)) < CONTRADICTION
    assert max(abs(found.lens.focal), abs(found.lens.radial)) < 0.02


def test_a_focal_length_that_is_too_long_is_seen(frames: list[Frame]) -> None:
    camera = frames[0].camera
    longer = PinholeCamera(camera.width, camera.height, camera.matrix * np.array([[1.06], [1.06], [1.0]]))
    longer.matrix[:2, 2] = camera.matrix[:2, 2]
    wrong = [replace(frame, camera=longer) for frame in frames]
    found = motion_estimate(paired(wrong, frames[0].camera_from_lidar), frames[0].camera_from_lidar)
    assert found is not None
    lens = found.lens
    assert lens.focal == pytest.approx(-np.log(1.06), abs=0.02)
    assert lens.focal_cost < 0.97 * lens.cost
    assert lens.focal_cost < min(lens.center_cost, lens.radial_cost, lens.equidistant_cost)


def test_nothing_is_said_of_a_car_that_stands_or_of_too_few_pairs(frames: list[Frame]) -> None:
    reference = frames[0].camera_from_lidar
    assert not paired([frames[0]] * 3, reference).pairs
    few = paired(frames[:FEWEST_PAIRS], reference)
    assert len(few.pairs) == FEWEST_PAIRS - 1 and motion_estimate(few, reference) is None
    assert motion_estimate(MotionPairs(reference), reference) is None


def test_frames_of_another_camera_or_without_anything_to_track_are_no_pair(frames: list[Frame]) -> None:
    reference = frames[0].camera_from_lidar
    other = PinholeCamera(frames[0].camera.width, frames[0].camera.height, frames[0].camera.matrix + np.eye(3))
    grey = [replace(frame, image=np.full_like(frame.image, 128)) for frame in frames[:2]]
    empty = [replace(frame, points=frame.points[:5]) for frame in frames[:2]]
    for two in ([frames[0], replace(frames[1], camera=other)], grey, empty):
        assert not paired(two, reference).pairs
