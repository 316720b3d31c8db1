from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from calibnet.datasets.frame import Frame, Frames, Sequence
from calibnet.errors import CalibrationError
from calibnet.evaluation.battery import PLAIN, Battery, BatteryRun, run_battery, two_mount_runs
from calibnet.evaluation.corruptions import Corruption
from calibnet.evaluation.faults import grey, unaltered
from calibnet.geometry import MiscalibrationRange, PoseError, pose_error, range_of, transform
from calibnet.geometry.types import Extrinsic
from calibnet.judging.causes import Search
from calibnet.judging.drive import FEWEST_JUDGED
from calibnet.trace import CascadeTrace, StageTrace
from calibnet.verdict import ACCEPTED, CANNOT_TELL, DRIVE_TOLERANCES, REJECTED, Cause, Verdict
from tests.support.drive import CAMERA, REFERENCE, Drive
from tests.support.scene import Scenes

MIRRORED = Corruption("mirrored", "", "mirrored", unaltered)


def off(degrees: float, centimetres: float) -> PoseError:
    return PoseError(degrees, centimetres, degrees, 0, 0, centimetres, 0, 0)


def test_rows_count_what_was_said_by_fault_and_strength() -> None:
    runs = (
        BatteryRun(PLAIN, off(0.2, 5), ACCEPTED),
        BatteryRun(PLAIN, off(0.2, 24.9), CANNOT_TELL),
        BatteryRun(PLAIN, off(1.1, 5), ACCEPTED),
        BatteryRun(MIRRORED, off(9, 80), REJECTED, ("left-handed", "mirrored")),
        BatteryRun(MIRRORED, off(9, 80), REJECTED, ("roll",)),
        BatteryRun(MIRRORED, off(9, 80), ACCEPTED, ("mirrored",)),
    )
    battery = Battery(runs)
    plain, mirrored = battery.rows
    assert vars(plain) == {
        "corruption": "none", "strength": "", "runs": 3, "accepted_right": 1, "accepted_wrong": 1, "rejected": 0,
        "cannot_tell": 1, "cause_right": 0,
    }  # fmt: skip
    assert (mirrored.runs, mirrored.accepted_wrong, mirrored.rejected, mirrored.cause_right) == (3, 1, 2, 1)
    assert battery.false_accept_rate == pytest.approx(2 / 6)
    assert battery.acceptance_of_good == pytest.approx(1 / 2)
    drive = BatteryRun(PLAIN, off(0.2, 24.9), CANNOT_TELL, (), DRIVE_TOLERANCES, DRIVE_TOLERANCES[1])
    assert not drive.is_right and runs[1].is_right
    assert drive.is_overclaimed and not replace(drive, within=None).is_overclaimed
    assert Battery((drive, *runs)).false_claim_rate == pytest.approx(1 / 7)
    assert not replace(drive, error=off(0.4, 14.9)).is_overclaimed
    assert battery.as_dict()["rows"][0] == vars(plain)


def test_rates_of_nothing_are_null() -> None:
    assert math.isnan(Battery(()).false_accept_rate)
    assert Battery(()).as_dict() == {
        "rows": [], "false_accept_rate": None, "false_claim_rate": None, "acceptance_of_good": None,
    }  # fmt: skip


class HalfWay:
    """A calibrator that finds everything but does not run on grey images."""

    def calibrate(self, frame: Frame, initial: Extrinsic, detail: bool = False) -> CascadeTrace:
        if frame.image.min() == 128:
            raise CalibrationError("nothing to see")
        after = frame.camera_from_lidar
        correction = after @ np.linalg.inv(initial)
        return CascadeTrace(
            initial, (StageTrace(5, MiscalibrationRange(1, 0.1), CAMERA, initial, after, correction, match_error_px=1),)
        )


def test_every_frame_is_judged_with_every_fault_from_the_guess_that_does_not_know_of_it() -> None:
    guesses: list[Extrinsic] = []

    def judge(frame: Frame, guess: Extrinsic, trace: CascadeTrace | None, late: Search | None) -> Verdict:
        guesses.append(guess)
        if trace is None:
            return Verdict(REJECTED, "", guess, causes=(Cause("other-picture", "", ""),))
        return Verdict(ACCEPTED, "", trace.stages[-1].after)

    turned = transform(np.diag([-1.0, -1.0, 1.0]), np.zeros(3)) @ REFERENCE
    rolled = Corruption("rolled", "180", "roll", lambda frame: replace(frame, camera_from_lidar=turned))
    far = Corruption("far-start", "x3", None, unaltered, farther=3.0)
    seen: list[BatteryRun] = []
    battery = run_battery(
        HalfWay(),
        judge,
        [Drive([3, 8])],
        lambda sequence, position: [Corruption("grey", "", None, grey), rolled, far],
        MiscalibrationRange(5, 0.5),
        repeats=2,
        observer=seen.append,
    )
    assert [(row.corruption, row.runs, row.accepted_right, row.rejected) for row in battery.rows] == [
        ("none", 4, 4, 0), ("grey", 4, 0, 4), ("rolled", 4, 4, 0), ("far-start", 4, 4, 0),
    ]  # fmt: skip
    assert seen == list(battery.runs) and battery.false_accept_rate == 0
    plain, gray, turned_guess, far_guess = (guesses[position] for position in (0, 2, 4, 6))
    assert np.array_equal(plain, gray) and np.array_equal(plain, turned_guess)  # what the user has, fault or not
    near = range_of(plain @ np.linalg.inv(REFERENCE))
    assert near.rotation_deg <= 5 and near.translation_m <= 0.5
    assert pose_error(far_guess, REFERENCE).translation_cm == pytest.approx(
        3 * pose_error(plain, REFERENCE).translation_cm, rel=0.2
    )


def test_two_mounts_are_a_row_of_drives_and_held_to_the_mount_that_is_farther_off() -> None:
    class FirstMount:
        """Accepts the extrinsic of a drive's first frame."""

        def calibrate_drive(self, frames: Frames, initial: Extrinsic) -> SimpleNamespace:
            return SimpleNamespace(verdict=Verdict(ACCEPTED, "", frames[0].camera_from_lidar))

    drives: list[Sequence] = [Scenes(6), Scenes(FEWEST_JUDGED - 1)]  # the second is too short
    runs = two_mount_runs(FirstMount(), drives, MiscalibrationRange(5, 0.5))  # type: ignore[arg-type]
    rows = {(row.corruption, row.strength): row for row in Battery(tuple(runs)).rows}
    assert rows["one-mount", ""].accepted_right == 1
    for strength in ("0.5 deg, 0 cm", "1 deg, 10 cm", "3 deg, 30 cm"):
        assert rows["two-mounts", strength].accepted_wrong == 1
