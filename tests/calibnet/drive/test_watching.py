"""Watching a drive with a solver that sees no farther than the real one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest

from calibnet.calibrator import DriveCalibrator
from calibnet.datasets.frame import Frame, Frames
from calibnet.drive.watching import consecutive_runs, watch_drive, watch_estimate
from calibnet.errors import CalibrationError, DatasetError
from calibnet.geometry import RANGES, miscalibration
from calibnet.geometry.se3 import invert, pose_vector
from calibnet.geometry.types import Extrinsic
from calibnet.trace import CascadeTrace, DriveEstimate, DriveLook
from calibnet.verdict import BadFrame
from tests.support.drive import REFERENCE, Drive


@dataclass
class Moving:
    """A drive whose mount is elsewhere from some frame on; some frames cannot be read."""

    count: int
    at: int
    to: Extrinsic
    bad: tuple[int, ...] = ()

    def __len__(self) -> int:
        return self.count

    def __getitem__(self, position: int) -> Frame:
        if position in self.bad:
            raise DatasetError("It is cut short.")
        frame = Drive(list(range(self.count)))[position]
        return replace(frame, camera_from_lidar=self.to @ REFERENCE) if position >= self.at else frame


class Solver:
    """Finds the extrinsic of the first frame it can read; others fit within the range of stage 4 around it."""

    def __init__(self) -> None:
        self.solved: list[int] = []

    def calibrate(self, frame: Frame, initial: Extrinsic, detail: bool = False) -> CascadeTrace:
        raise NotImplementedError

    def calibrate_drive(
        self, frames: Frames, initial: Extrinsic, observer: Callable[[int, int], None] | None = None
    ) -> DriveEstimate:
        self.solved.append(len(frames))
        there, looks, skipped = None, [], []
        for position in range(len(frames)):
            try:
                frame = frames[position]
            except DatasetError as error:
                skipped.append(BadFrame(position, str(error)))
                continue
            there = frame.camera_from_lidar if there is None else there
            correction = frame.camera_from_lidar @ invert(there)
            if not RANGES[3].contains(correction):
                skipped.append(BadFrame(frame.index, "It does not fit."))
                continue
            seen = np.clip(pose_vector(correction), -0.02, 0.02)  # a look saturates
            error = np.random.default_rng(frame.index).normal(size=6) * [0.02, 0.02, 0.03, 1e-3, 1e-3, 2e-3]
            looks.append(DriveLook(frame.index, position, seen + error))
        if there is None:
            raise CalibrationError("Nothing fits.")
        return DriveEstimate(
            there, np.eye(6) * 1e-4, len(looks), skipped=tuple(skipped), looks=tuple(looks), looked_from=there
        )


STILL = np.eye(4)


def test_a_mount_that_does_not_move() -> None:
    solver: DriveCalibrator = Solver()
    watched = watch_drive(solver, Moving(60, 99, STILL, bad=(7,)), REFERENCE)
    assert watched.watch is not None and watched.watch.changes == () and watched.reason == ""
    assert watched.used == 59 and [bad.frame for bad in watched.skipped] == [7]


@pytest.mark.parametrize(
    ("at", "degrees"), [(30, 0.7), (30, 1.8), (30, 6.0), (45, 6.0), (15, 6.0)], ids=lambda value: f"{value:g}"
)
def test_a_step_of_any_size_is_found_and_measured(at: int, degrees: float) -> None:
    to = miscalibration([0, 0, degrees], [0, 0, 0])
    watched = watch_drive(Solver(), Moving(60, at, to), REFERENCE)
    assert watched.watch is not None
    (change,) = watched.watch.changes
    assert abs(change.frame - at) <= 2 and change.rotation_deg == pytest.approx(degrees, abs=0.12)
    assert watched.used == 60 and watched.skipped == ()


def test_what_cannot_be_told_says_why() -> None:
    few = watch_drive(Solver(), Moving(12, 99, STILL), REFERENCE)
    assert few.watch is None and few.reason == "12 frames are too few to detect a change; 16 are needed."
    unread = watch_drive(Solver(), Moving(40, 99, STILL, bad=(*range(0, 40, 2), 1, 3)), REFERENCE)
    assert unread.watch is None and unread.reason == "Only 18 of 40 frames can be read and fit."
    nothing = watch_drive(Solver(), Moving(40, 99, STILL, bad=tuple(range(40))), REFERENCE)
    assert nothing.reason == "Image and scan do not fit together in any part of the drive."


def test_a_drive_that_is_solved_tells_it_at_no_cost() -> None:
    moving = Moving(60, 30, miscalibration([0, 0, 0.7], [0, 0, 0]), bad=(7,))
    solved = Solver().calibrate_drive(moving, REFERENCE)
    watched = watch_estimate(solved, 60)
    assert watched.watch is not None and watched.used == 59 and [bad.frame for bad in watched.skipped] == [7]
    (change,) = watched.watch.changes
    assert abs(change.frame - 30) <= 2 and change.rotation_deg == pytest.approx(0.7, abs=0.12)
    half = watch_estimate(replace(solved, looks=solved.looks[:29]), 60)
    assert half.watch is None and half.reason == "Only 29 of 60 frames can be read and fit."


def test_runs_of_positions() -> None:
    assert consecutive_runs([3, 4, 5, 9, 11, 12]) == [(3, 6), (9, 10), (11, 13)] and consecutive_runs([]) == []
