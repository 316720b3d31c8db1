"""The verdict on a drive, by how far it went, how many frames could be used, and how sure they are together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calibnet.geometry import RANGES, MiscalibrationRange, miscalibration
from calibnet.judging.classifier import Classifier
from calibnet.judging.drive import judge_drive
from calibnet.judging.drive_predictors import apart, drive_predictors, halves_cm
from calibnet.trace import MARGIN, DriveEstimate, DriveLook, LensReading, MotionEstimate
from calibnet.verdict import DRIVE_LIMITS, DRIVE_TOLERANCES, BadFrame
from tests.support.boxes import REFERENCE

CLASSIFIER = Classifier(-1.0, {"match_error": 2.0}, 0.6, 0.8)
"""Accepts match errors of less than 2 px."""
READING = LensReading(100.0, 90.0, 95.0, 99.0, 200.0, 0.001, 0.0, 0.0, 0.0)

STEADY = LensReading(100.0, 99.0, 98.0, 99.0, 200.0, 0.001, 0.0, 0.0, 0.0)
"""Motion that no other lens explains better."""


def estimate(
    yaw: float = 0.0,
    ahead: float = 0.0,
    degrees: float = 0.1,
    centimetres: float = 3.0,
    bad: int = 0,
    error: float = 1.5,
    halves: float = 0.0,
) -> DriveEstimate:
    """Of ten frames: where it lies from the reference, and its standard deviation an axis."""
    sigma = [centimetres / 100] * 3 + [float(np.radians(degrees))] * 3
    skipped = tuple(BadFrame(frame, "It is cut short.") for frame in range(bad))
    looks = tuple(
        DriveLook(frame, frame, np.array([0, 0, halves / 100 * (frame > 4), 0, 0, 0]), None, error, READING)
        for frame in range(10)
    )
    there = miscalibration([0, 0, yaw], [0, 0, ahead]) @ REFERENCE
    return DriveEstimate(there, np.diag(np.square(sigma)), 10 - bad, skipped=skipped, looks=looks, looked_from=there)


@pytest.mark.parametrize(
    ("drive", "word", "reason"),
    [
        (estimate(yaw=4.0, ahead=0.4), "accepted", "10 frames agree."),
        (estimate(yaw=5.9), "accepted", "10 frames agree."),  # within 1.2 times the range
        (estimate(yaw=6.1), "rejected", "outside the range searched (±5°/0.5 m)"),
        (estimate(ahead=-0.7), "rejected", "The result lies 0° and 70 cm from the start"),
        (estimate(degrees=0.2), "cannot tell", "only to 0.35° and 5 cm"),  # 0.2 on each of three axes
        (estimate(centimetres=8.0), "cannot tell", "only to 0.17° and 14 cm"),
        (estimate(error=2.5), "cannot tell", "The result of 10 frames is not certain to be within 0.3° / 8 cm"),
        (estimate(error=4.0), "cannot tell", "(probability of a larger error: 85%)."),
        (estimate(error=2.5, halves=40), "cannot tell", "%); the halves of the drive differ by 40 cm."),
        (estimate(bad=4), "accepted", "6 frames agree."),
        (estimate(bad=5), "rejected", "Only 5 of 10 frames could be used. It is cut short."),
    ],
)
def test_the_word_and_its_reason(drive: DriveEstimate, word: str, reason: str) -> None:
    verdict = judge_drive(drive, REFERENCE, RANGES[2], CLASSIFIER)
    assert verdict.word == word and reason in verdict.reason
    assert verdict.used == drive.frames and verdict.skipped == drive.skipped
    np.testing.assert_array_equal(verdict.camera_from_lidar, drive.camera_from_lidar)
    if word != "accepted":  # an accepted one is known better, see below
        np.testing.assert_array_equal(verdict.covariance, drive.covariance)


def test_who_is_certain_of_a_result_knows_it_to_within_that_tolerance() -> None:
    doubted = estimate(degrees=0.15, centimetres=5.0)  # 0.26 degrees and 8.7 cm over all axes
    verdict = judge_drive(doubted, REFERENCE, RANGES[2], CLASSIFIER)
    assert verdict.word == "accepted" and verdict.covariance is not None
    generator = np.random.default_rng(0)
    errors = generator.multivariate_normal(np.zeros(6), doubted.covariance, 400_000)
    turns, shifts = np.linalg.norm(errors[:, 3:], axis=1), np.linalg.norm(errors[:, :3], axis=1)
    kept = errors[(turns < np.radians(DRIVE_LIMITS.rotation_deg)) & (shifts < DRIVE_LIMITS.translation_cm / 100)]
    np.testing.assert_allclose(np.sqrt(np.diag(verdict.covariance)), kept.std(axis=0), rtol=0.01)
    assert 100 * np.sqrt(np.trace(verdict.covariance[:3, :3])) < 6
    judged = doubted.judged(verdict)
    assert judged.verdict is verdict and judged.covariance is verdict.covariance


def test_of_a_result_that_is_stated_far_within_the_tolerance_nothing_more_is_known() -> None:
    sure = estimate(degrees=0.02, centimetres=0.5)
    covariance = judge_drive(sure, REFERENCE, RANGES[2], CLASSIFIER).covariance
    np.testing.assert_allclose(covariance, sure.covariance, rtol=1e-6)


def test_what_is_not_accepted_may_be_certain_of_a_coarser_tolerance() -> None:
    coarser = replace(CLASSIFIER, coarser=replace(CLASSIFIER, intercept=-2.0))  # accepts up to 3.3 px
    verdicts = [judge_drive(estimate(error=of), REFERENCE, RANGES[2], coarser) for of in (1.5, 2.5, 4.0)]
    assert [verdict.within for verdict in verdicts] == [DRIVE_LIMITS, DRIVE_TOLERANCES[1], None]
    assert [verdict.word for verdict in verdicts] == ["accepted", "cannot tell", "cannot tell"]
    assert "is within 0.5° / 15 cm, but perhaps not within 0.3° / 8 cm" in verdicts[1].reason
    assert judge_drive(estimate(error=1.5, degrees=0.2), REFERENCE, RANGES[2], coarser).within is None


@pytest.mark.parametrize(
    ("drive", "searched", "advice"),
    [
        (estimate(), RANGES[2], ""),
        (estimate(yaw=6.1), RANGES[2], "run all stages (--stages 1-5); if it cannot be, check the camera matrix"),
        (estimate(yaw=25.0), RANGES[0], "Check the camera matrix, the lens and the time stamps."),  # all stages ran
        (estimate(degrees=0.2), RANGES[2], "Add frames of other places; if that does not help, check the camera"),
        (estimate(error=2.5), RANGES[2], "Use more frames, some dozens, of different places"),
        (replace(estimate(error=2.5), frames=500), RANGES[2], "Judge several drives on this mount together"),
        (replace(estimate(), looks=()), RANGES[2], "Take frames in which poles, cars or walls"),
    ],
)
def test_what_to_do_next(drive: DriveEstimate, searched: MiscalibrationRange, advice: str) -> None:
    found = judge_drive(drive, REFERENCE, searched, CLASSIFIER).advice
    assert advice in found and bool(found) == bool(advice)


def test_edges_that_ask_for_another_place_than_the_networks_are_told() -> None:
    doubtful = estimate(error=2.5)
    networks = replace(doubtful, camera_from_lidar=miscalibration([0, 0, 0], [0, 0.09, 0]) @ doubtful.camera_from_lidar)
    verdict = judge_drive(replace(doubtful, networks=networks), REFERENCE, RANGES[2], CLASSIFIER)
    assert verdict.reason.endswith("; edges and networks differ by 9 cm, and either may be right.")


def in_motion(sideways: float, lens: LensReading = STEADY) -> DriveEstimate:
    """A drive whose motion shows an extrinsic so many metres beside that of its frames, each known to 3 cm an axis."""
    drive = estimate()
    there = miscalibration([0, 0, 0], [sideways, 0, 0]) @ drive.camera_from_lidar
    motion = MotionEstimate(there, drive.covariance, 12, tracks=900, moved_m=12.0, error_px=0.6, lens=lens)
    return replace(drive, motion=motion)


def test_a_drive_whose_motion_contradicts_its_frames_cannot_be_told() -> None:
    verdict = judge_drive(in_motion(0.1), REFERENCE, RANGES[2], CLASSIFIER)
    assert verdict.word == "accepted"
    verdict = judge_drive(in_motion(0.3), REFERENCE, RANGES[2], CLASSIFIER)  # 7 standard deviations
    assert verdict.word == "cannot tell" and "0.00° / 30.0 cm away" in verdict.reason
    assert "check the camera matrix" in verdict.advice
    unsure = in_motion(0.3)
    assert unsure.motion is not None
    unsure = replace(unsure, motion=replace(unsure.motion, covariance=9 * unsure.covariance))
    assert judge_drive(unsure, REFERENCE, RANGES[2], CLASSIFIER).word == "accepted"  # 16 cm are too uncertain


@pytest.mark.parametrize(
    ("costs", "named"),
    [
        ({}, []),
        ({"focal_cost": 96.0, "focal": -0.05}, []),
        ({"focal_cost": 90.0, "focal": -0.05}, ["focal-length"]),
        ({"focal_cost": 90.0, "center_cost": 85.0, "right": 0.02}, ["principal-point"]),
        ({"radial_cost": 85.0, "focal_cost": 90.0}, ["distortion", "lens-model"]),
        ({"equidistant_cost": 60.0}, ["distortion", "lens-model"]),
    ],
)
def test_a_fault_of_the_lens_is_named_if_it_explains_the_motion(costs: dict[str, float], named: list[str]) -> None:
    lens = STEADY._replace(**costs)
    verdict = judge_drive(in_motion(0.0, lens), REFERENCE, RANGES[2], CLASSIFIER)
    assert [cause.name for cause in verdict.causes] == named
    assert verdict.word == ("rejected" if named else "accepted")
    if named == ["focal-length"]:
        assert "4.9% shorter than camera_matrix says" in verdict.reason


def test_two_or_three_frames_are_no_drive_to_be_sure_of() -> None:
    few = replace(estimate(), frames=3, looks=estimate().looks[:3])
    verdict = judge_drive(few, REFERENCE, RANGES[2], CLASSIFIER)
    assert verdict.word == "cannot tell" and verdict.reason == (
        "A drive is judged by at least 4 frames of different moments; this one has 3 frames."
    )
    four = replace(few, frames=4, looks=estimate().looks[:4])
    assert judge_drive(four, REFERENCE, RANGES[2], CLASSIFIER).word == "accepted"
    two_cameras = replace(four, looks=(*four.looks[:2], *four.looks[:2]))
    verdict = judge_drive(two_cameras, REFERENCE, RANGES[2], CLASSIFIER)
    assert verdict.word == "cannot tell" and verdict.reason.endswith("has 4 frames of 2 moments.")


def test_a_start_in_the_corner_of_the_range_is_within_it() -> None:
    """The correction of such a start is not: its translation is turned, and reaches 1.5 times as far."""
    drive, corner = estimate(), miscalibration([20, 20, -20], [1.5, 1.5, 1.5]) @ REFERENCE
    assert not RANGES[0].contains(drive.camera_from_lidar @ np.linalg.inv(corner), MARGIN)
    assert judge_drive(drive, corner, RANGES[0], CLASSIFIER).word == "accepted"


def test_by_no_coefficients_no_drive_is_accepted() -> None:
    verdict = judge_drive(estimate(), REFERENCE, RANGES[2], "Nothing was fitted.")
    assert verdict.word == "cannot tell"
    assert verdict.reason == "10 frames agree, but how reliable that is cannot be judged. Nothing was fitted."
    assert judge_drive(estimate(yaw=6.1), REFERENCE, RANGES[2], "Nothing was fitted.").word == "rejected"


def test_predictors_of_a_drive() -> None:
    found = drive_predictors(estimate(yaw=2.5, halves=24))
    assert found is not None
    assert vars(found) == pytest.approx({"match_error": np.log(1.5), "aligned": np.log(1e-6), "lens": np.log(0.9)})
    assert halves_cm(estimate(halves=24).looks) == pytest.approx(24)
    assert apart(np.zeros(6), np.array([0, 0, 0, 0, np.radians(0.3), 0])) == pytest.approx(8.0)
    silent = replace(estimate(), looks=())
    assert drive_predictors(silent) is None
    assert judge_drive(silent, REFERENCE, RANGES[2], CLASSIFIER).word == "cannot tell"
