"""Poses and what is done to them."""

from __future__ import annotations

import numpy as np
import pytest

from calibnet.geometry import MiscalibrationRange, miscalibration, pose_error
from inspector.live.pose import Pose
from inspector.live.workspace import Workspace
from inspector.run.start import Start
from tests.support.fakes import REFERENCE, FakeSequence


def workspace(as_is: bool = False) -> Workspace:
    return Workspace(FakeSequence(2), [0, 1], Start(MiscalibrationRange(5, 0.5), 3, as_is=as_is))


def test_a_pose_is_the_change_that_a_miscalibration_is() -> None:
    pose = Pose(1.0, -2.0, 3.0, 0.1, -0.2, 0.3)
    extrinsic = pose.applied_to(REFERENCE)
    np.testing.assert_array_equal(extrinsic, miscalibration([1, -2, 3], [0.1, -0.2, 0.3]) @ REFERENCE)
    assert Pose.between(extrinsic, REFERENCE) == pytest.approx(pose)
    error = pose_error(miscalibration([0, 0, 2], [0, 0, 0]), np.eye(4))
    assert error.yaw_deg == pytest.approx(2.0)


@pytest.mark.parametrize("pose", [Pose(np.nan), Pose(200.0), Pose(x=1e9), Pose(z=np.inf)])
def test_what_is_no_pose_is_known(pose: Pose) -> None:
    assert not pose.is_finite()
    assert Pose(180.0, x=-100.0).is_finite()


def test_every_move_can_be_undone_and_redone() -> None:
    one = workspace()
    poses = [Pose(roll=1.0), Pose(roll=2.0), Pose(roll=2.0), Pose(yaw=1.0)]
    for pose in poses:
        one.move(pose)
    seen = [one.pose]
    while one.can_undo:
        one.undo()
        seen.append(one.pose)
    assert seen == [Pose(yaw=1.0), Pose(roll=2.0), Pose(roll=1.0), Pose()]  # what did not change was no move
    one.undo()
    one.redo()
    one.redo()
    assert one.pose == Pose(roll=2.0)
    one.move(Pose(x=0.1))
    assert not one.can_redo


def test_the_reference_is_arrived_at_exactly() -> None:
    one = workspace()
    assert one.reference is not None
    assert pose_error(one.extrinsic, one.reference).rotation_deg > 1.0
    one.move_to(one.reference)
    np.testing.assert_allclose(one.extrinsic, one.reference, atol=1e-12)


@pytest.mark.parametrize("as_is", [False, True])
def test_random_poses_lie_around_the_truth_or_the_guess(as_is: bool) -> None:
    one = workspace(as_is)
    assert (one.reference is None) == as_is
    around = one.guess if one.reference is None else one.reference
    range_ = MiscalibrationRange(2, 0.2)
    found = []
    for _ in range(5):
        one.move_randomly(range_)
        assert range_.contains(one.extrinsic @ np.linalg.inv(around), 1.0 + 1e-6)
        found.append(one.pose)
    assert len(set(found)) == 5


def test_the_first_random_pose_is_not_the_guess_that_was_drawn_alike() -> None:
    range_ = MiscalibrationRange(5, 0.5)
    one = Workspace(FakeSequence(2), [0, 1], Start(range_, 3), seed=3)
    one.move_randomly(range_)
    assert pose_error(one.extrinsic, one.guess).rotation_deg > 0.1


def test_another_frame_keeps_the_pose() -> None:
    one = workspace()
    one.move(Pose(roll=1.0))
    one.show(1, one.frames[1])
    assert (one.frame.index, one.position, one.pose) == (1, 1, Pose(roll=1.0))
