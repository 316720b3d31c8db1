from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from calibnet.datasets import Sequence
from calibnet.errors import CalibrationError
from calibnet.evaluation.drives import evaluate_drives, shares_mount
from calibnet.geometry import MiscalibrationRange, miscalibration, pose_error
from calibnet.geometry.types import Transform
from calibnet.trace import DriveEstimate, Estimate
from tests.support.drive import REFERENCE, Drive

RANGE = MiscalibrationRange(5, 0.5)


class Solver:
    """Ends half a degree of yaw beside the truth, its networks thrice as far if it aligns; or fails."""

    def __init__(self, fails: bool = False, aligns: bool = True) -> None:
        self.fails, self.aligns, self.initials = fails, aligns, list[Transform]()

    def calibrate_drive(
        self, frames: Sequence, initial: Transform, observer: Callable[[int, int], None] | None = None
    ) -> DriveEstimate:
        self.initials.append(initial)
        if self.fails:
            raise CalibrationError("no frame")
        if observer is not None:
            observer(0, len(frames))
        networks = Estimate(miscalibration([0, 0, 1.5], [0, 0, 0]) @ REFERENCE, np.eye(6), len(frames))
        found = miscalibration([0, 0, 0.5], [0, 0, 0]) @ REFERENCE
        return DriveEstimate(found, np.eye(6), len(frames), networks=networks if self.aligns else None)


def test_every_drive_is_solved_from_every_miscalibration() -> None:
    solver, told = Solver(), []
    drives: list[Sequence] = [Drive([0, 1, 2]), Drive([0, 1], "other")]
    metrics = evaluate_drives(solver, drives, RANGE, 3, 7, lambda *seen: told.append(seen))
    assert metrics is not None and metrics.estimate.rotation_deg.yaw == pytest.approx(0.5)
    assert metrics.networks is not None and metrics.networks.rotation_deg.yaw == pytest.approx(1.5)
    assert len({initial.tobytes() for initial in solver.initials}) == 6
    assert told == [("test/drive", 0, 3)] * 3 + [("other", 0, 2)] * 3
    again = Solver()
    evaluate_drives(again, drives, RANGE, 3, 7)
    np.testing.assert_array_equal(again.initials, solver.initials)


def test_a_drive_that_cannot_be_solved_keeps_its_initial_error() -> None:
    solver = Solver(fails=True)
    metrics = evaluate_drives(solver, [Drive([0, 1])], RANGE, 1, 0)
    assert metrics is not None
    initial = pose_error(solver.initials[0], REFERENCE)
    assert metrics.estimate.rotation_deg.mean == pytest.approx(initial.rotation_deg) and metrics.networks is None


def test_networks_have_no_row_of_their_own_where_nothing_is_aligned() -> None:
    metrics = evaluate_drives(Solver(aligns=False), [Drive([0, 1])], RANGE, 1, 0)
    assert metrics is not None and metrics.networks is None


def test_frames_of_several_mounts_are_no_drive() -> None:
    assert shares_mount(Drive([0, 1, 2]))
    assert not shares_mount(Drive([0, 1, 2], moving=True))
    assert not shares_mount(Drive([0]))
    assert evaluate_drives(Solver(), [Drive([0, 1], moving=True)], RANGE, 1, 0) is None
