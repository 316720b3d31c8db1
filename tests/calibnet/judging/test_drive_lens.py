"""Faults of the lens that the frames of a drive show together, and the verdict on such a drive."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from calibnet.geometry import RANGES
from calibnet.judging.classifier import Classifier
from calibnet.judging.drive import FEWEST_JUDGED, judge_drive
from calibnet.judging.drive_lens import drive_lens_causes, drive_lens_predictors, lens_reading, median_reading
from calibnet.judging.lens_causes import FAULTS, LensOdds
from calibnet.trace import DriveEstimate, DriveLook, LensReading
from tests.support.drive import REFERENCE
from tests.support.matches import CAMERA, matches, run

ODDS = LensOdds(
    0.6,
    dict.fromkeys(FAULTS, -4.0),
    {
        "focal-length": {"focal_size": 400.0},
        "principal-point": {"right_size": 400.0, "down_size": 400.0},
        "distortion": {"radial": -400.0},
    },
)
"""A fault is as probable as none if its value is 0.01, and certain at 0.03."""
EVERYTHING = Classifier(0.0, {}, accepted_below=1.0, rejected_above=1.0)
PLAIN = LensReading(100.0, 98.0, 97.0, 99.0, 400.0, focal=0.001, right=0.002, down=-0.003, radial=0.001)


def looks(*readings: LensReading | None) -> tuple[DriveLook, ...]:
    return tuple(
        DriveLook(frame, frame, np.zeros(6), match_error_px=1.0, lens=reading) for frame, reading in enumerate(readings)
    )


def drive(*readings: LensReading | None) -> DriveEstimate:
    covariance = np.diag([0.02**2] * 3 + [math.radians(0.05) ** 2] * 3)
    return DriveEstimate(REFERENCE, covariance, len(readings), looks=looks(*readings), looked_from=REFERENCE)


def test_a_look_is_read_with_every_lens() -> None:
    trace = run(REFERENCE, REFERENCE, matches(np.eye(4), lambda places: 0.97 * places + np.array([0, 0.02]), noise=0.5))
    found = lens_reading(trace.stages[-1])
    assert found is not None and found.focal_cost < 0.9 * found.cost
    assert found.focal == pytest.approx(math.log(0.97), abs=0.01)
    lower = run(REFERENCE, REFERENCE, matches(np.eye(4), lambda places: places + np.array([0.03, 0.05]), noise=0.5))
    found = lens_reading(lower.stages[-1])
    assert found is not None and found.gain == math.log(found.center_cost / found.cost)
    across, down = 0.03 * CAMERA.focal[0] / CAMERA.width, 0.05 * CAMERA.focal[1] / CAMERA.width
    assert (found.right, found.down) == pytest.approx((across, down), rel=0.15)
    assert lens_reading(run(REFERENCE, REFERENCE).stages[-1]) is None, "there are no matches"


def test_costs_add_up_and_one_frame_that_shows_another_lens_changes_no_median() -> None:
    odd = PLAIN._replace(cost=300.0, focal_cost=100.0, focal=-0.2, radial=-0.4)
    found = median_reading(looks(PLAIN, None, odd, PLAIN, PLAIN._replace(focal=0.003)))
    assert found is not None
    assert (found.cost, found.focal_cost, found.equidistant_cost) == (600.0, 394.0, 1600.0)
    assert (found.focal, found.right, found.down, found.radial) == (0.001, 0.002, -0.003, 0.001)
    said = drive_lens_predictors(found)
    assert said.focal_gain == pytest.approx(1 - 394 / 600) and said.down_size == 0.003
    assert said.equidistant_gain == -1.0, "at most twice the cost is told"
    assert median_reading(looks(None, None)) is None


@pytest.mark.parametrize(
    ("shown", "names", "text"),
    [
        ({}, [], ""),
        ({"focal": -0.03}, ["focal-length"], "more than 3.0% shorter"),
        ({"right": 0.03}, ["principal-point"], "more than 3.0% of the width farther to the right"),
        ({"down": -0.03}, ["principal-point"], "more than 3.0% of the width farther up"),
        ({"radial": -0.03}, ["distortion", "lens-model"], "looks barrel-distorted"),
    ],
)
def test_a_drive_whose_frames_show_a_fault_of_the_lens_is_rejected_and_names_it(
    shown: dict[str, float], names: list[str], text: str
) -> None:
    frames = [PLAIN._replace(**shown)] * 4 + [PLAIN]
    verdict = judge_drive(drive(*frames), REFERENCE, RANGES[2], EVERYTHING, ODDS)
    assert [cause.name for cause in verdict.causes] == names
    assert verdict.word == ("rejected" if names else "accepted")
    assert text in verdict.reason and verdict.advice == ""
    if names:
        assert verdict.reason.startswith("Its frames show a fault of the lens. The image looks ")


def test_too_few_frames_and_no_coefficients_name_nothing() -> None:
    wrong = [PLAIN._replace(focal=0.05)] * (FEWEST_JUDGED - 1)
    assert judge_drive(drive(*wrong), REFERENCE, RANGES[2], EVERYTHING, ODDS).causes == ()
    whole = drive(*wrong, wrong[0])
    assert judge_drive(whole, REFERENCE, RANGES[2], EVERYTHING, ODDS).causes
    assert judge_drive(whole, REFERENCE, RANGES[2], EVERYTHING).causes == ()
    assert drive_lens_causes(whole.looks, replace(ODDS, named_from=1.0), FEWEST_JUDGED) == ()
    assert drive_lens_causes(looks(None), ODDS, 1) == ()


def test_on_a_rig_every_camera_has_a_lens_of_its_own() -> None:
    left = [replace(look, camera="left") for look in looks(*[PLAIN] * 4)]
    right = [replace(look, camera="right") for look in looks(*[PLAIN._replace(focal=0.05)] * 4)]
    (cause,) = drive_lens_causes([*left, *right], ODDS, FEWEST_JUDGED)
    assert cause.name == "focal-length" and cause.text.startswith("Camera right: The image looks as if its focal")
    assert drive_lens_causes([*left, *right[1:], right[1]], ODDS, FEWEST_JUDGED) == (), "of three moments"
