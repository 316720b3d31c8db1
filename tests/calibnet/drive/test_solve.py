"""Frames of a drive that cannot be used are named by their numbers, however the drive is cut."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pytest

from calibnet.cascade.prepared import PreparedFrames
from calibnet.cascade.upright import Upright
from calibnet.datasets.frame import Frame, Frames
from calibnet.datasets.selection import PickedFrames
from calibnet.drive.moving import PAIRS, Moving
from calibnet.drive.readings import Observed, Readings
from calibnet.drive.solve import DriveLooks, agree, solve_drive
from calibnet.drive.watching import Part, watch_estimate
from calibnet.errors import CalibrationError, DatasetError
from calibnet.geometry import RANGES, MiscalibrationRange
from calibnet.geometry.types import Extrinsic
from calibnet.motion import MotionPairs
from calibnet.trace import LensReading, MotionEstimate, StageTrace
from tests.support.drive import CAMERA, REFERENCE, Drive


@dataclass
class From1(Drive):
    """Frames 1 to 40, as files are numbered, of which some are damaged."""

    numbers: list[int] = field(default_factory=lambda: list(range(1, 41)))
    damaged: tuple[int, ...] = (6,)

    def index_of(self, position: int) -> int:
        return self.numbers[position]

    def __getitem__(self, position: int) -> Frame:
        if self.numbers[position] in self.damaged:
            raise DatasetError("It is cut short.")
        return super().__getitem__(position)


@dataclass
class Looking:
    """Finds every frame as it is, but for some that do not fit."""

    unfit: tuple[int, ...] = ()
    range: MiscalibrationRange = RANGES[3]
    match_error_limit_px: float = 5.0

    def view(self, frame: Frame) -> None:
        return None

    def look(self, frame: Frame, view: None, before: Extrinsic) -> StageTrace:
        if frame.index in self.unfit:
            raise CalibrationError("It does not fit.")
        return StageTrace(4, self.range, CAMERA, before, before, np.eye(4), information=2 * self.range.information)


def test_a_frame_that_cannot_be_read_is_named_as_one_that_does_not_fit_is() -> None:
    estimate = solve_drive([Looking(unfit=(20,))], From1(), REFERENCE, np.zeros((6, 6)))
    assert [bad.frame for bad in estimate.skipped] == [6, 20]
    assert [look.frame for look in estimate.looks] == [n for n in range(1, 41) if n not in (6, 20)]


def test_watching_names_it_too() -> None:
    """Position 5 holds frame 6; frame 5 was used."""
    estimate = solve_drive([Looking()], From1(), REFERENCE, np.zeros((6, 6)))
    watched = watch_estimate(estimate, 40)
    assert [bad.frame for bad in watched.skipped] == [6] and watched.used == 39


@pytest.mark.parametrize(
    "frames",
    [
        Part(From1(), 4, 30),
        PickedFrames(From1(), [2, 5, 7]),
        PreparedFrames(From1(), Upright.of(REFERENCE, RANGES[3])),
        Observed(From1(), Readings(None, 40)),
        PreparedFrames(Part(PickedFrames(From1(), range(1, 40)), 3, 9), Upright.of(REFERENCE, RANGES[3])),
    ],
    ids=lambda frames: type(frames).__name__,
)
def test_a_part_of_a_drive_names_it_too(frames: Frames) -> None:
    looks = DriveLooks(Looking(), frames, range(len(frames)), REFERENCE)
    assert len(agree(looks)) == len(frames) - 1
    assert [bad.frame for bad in looks.skipped] == [6]


def test_frames_that_do_not_say_are_named_once_they_are_read() -> None:
    estimate = solve_drive([Looking((3,))], list(From1(damaged=())), REFERENCE, np.zeros((6, 6)))
    assert [bad.frame for bad in estimate.skipped] == [3], "at position 2"


def test_a_drive_without_a_frame_that_can_be_used_says_why() -> None:
    with pytest.raises(DatasetError, match="cut short"):
        solve_drive([Looking()], From1(damaged=tuple(range(1, 41))), REFERENCE, np.eye(6))
    with pytest.raises(CalibrationError, match="does not fit"):
        solve_drive([Looking(unfit=tuple(range(1, 41)))], From1(damaged=()), REFERENCE, np.eye(6))


def test_every_reading_is_told_and_the_end_as_well() -> None:
    told: list[tuple[int, int]] = []
    solve_drive([Looking()], From1(), REFERENCE, np.eye(6), lambda *numbers: told.append(numbers))
    total = 2 * 24 + 40
    assert told == [(done, total) for done in range(total + 1)]


def test_what_the_motion_shows_is_kept_and_the_result_is_that_of_the_frames(monkeypatch: pytest.MonkeyPatch) -> None:
    alone = solve_drive([Looking(range=RANGES[-1])], From1(), REFERENCE, np.zeros((6, 6)))
    assert alone.motion is None
    reading = LensReading(*[1.0] * 5, *[0.0] * 4)
    motion = MotionEstimate(REFERENCE, np.eye(6), 12, tracks=900, moved_m=12.0, error_px=0.6, lens=reading)
    monkeypatch.setattr(Moving, "estimate", lambda self, extrinsic: motion)
    both = solve_drive([Looking(range=RANGES[-1])], From1(), REFERENCE, np.zeros((6, 6)))
    assert both.motion is motion
    np.testing.assert_array_equal(both.camera_from_lidar, alone.camera_from_lidar)


def test_pairs_of_motion_are_successive_frames_spread_over_the_drive(monkeypatch: pytest.MonkeyPatch) -> None:
    added: list[tuple[int, int]] = []
    monkeypatch.setattr(MotionPairs, "add", lambda self, one, other: added.append((one.index, other.index)))
    moving, drive = Moving(REFERENCE, 40), From1()
    for position in range(40):
        if position != 5:  # damaged
            moving.note(position, drive[position])
    assert len(added) == PAIRS and all(other == one + 1 for one, other in added)
    assert added[-1] == (39, 40) and np.ptp([one for one, _ in added]) > 30
