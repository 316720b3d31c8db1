"""The verdict on a drive, by how far it went, how many frames could be used, and how sure they are together."""

from __future__ import annotations

import numpy as np
import pytest

from calibnet.geometry import RANGES, miscalibration
from calibnet.judging.doubt import Doubt
from calibnet.judging.drive import judge_drive
from calibnet.trace import DriveEstimate
from calibnet.verdict import BadFrame
from tests.support.boxes import REFERENCE

DOUBT = Doubt(0.0, {}, 0.6, 0.8)


def estimate(
    yaw: float = 0.0, ahead: float = 0.0, degrees: float = 0.1, centimetres: float = 3.0, bad: int = 0
) -> DriveEstimate:
    """Of ten frames: where it lies from the reference, and its standard deviation an axis."""
    sigma = [centimetres / 100] * 3 + [float(np.radians(degrees))] * 3
    skipped = tuple(BadFrame(frame, "It is cut short.") for frame in range(bad))
    there = miscalibration([0, 0, yaw], [0, 0, ahead]) @ REFERENCE
    return DriveEstimate(there, np.diag(np.square(sigma)), 10 - bad, skipped=skipped)


@pytest.mark.parametrize(
    ("drive", "word", "reason"),
    [
        (estimate(yaw=4.0, ahead=0.4), "accepted", "10 frames agree."),
        (estimate(yaw=5.9), "accepted", "10 frames agree."),  # within 1.2 times the range
        (estimate(yaw=6.1), "rejected", "out of the range that was to be searched, ±5°/0.5 m"),
        (estimate(ahead=-0.7), "rejected", "It lies 0° and 70 cm from the start"),
        (estimate(degrees=0.2), "cannot tell", "leave it open to 0.35° and 5 cm"),  # 0.2 on each of three axes
        (estimate(centimetres=8.0), "cannot tell", "leave it open to 0.17° and 14 cm"),
        (estimate(bad=4), "accepted", "6 frames agree."),
        (estimate(bad=5), "rejected", "Only 5 of 10 frames could be used. It is cut short."),
    ],
)
def test_the_word_and_its_reason(drive: DriveEstimate, word: str, reason: str) -> None:
    verdict = judge_drive(drive, REFERENCE, RANGES[2], DOUBT)
    assert verdict.word == word and reason in verdict.reason
    assert verdict.used == drive.frames and verdict.skipped == drive.skipped
    np.testing.assert_array_equal(verdict.camera_from_lidar, drive.camera_from_lidar)
    np.testing.assert_array_equal(verdict.covariance, drive.covariance)


def test_by_no_coefficients_no_drive_is_accepted() -> None:
    verdict = judge_drive(estimate(), REFERENCE, RANGES[2], "Nothing was fitted.")
    assert verdict.word == "cannot tell"
    assert verdict.reason == "10 frames agree, but how sure that is cannot be told. Nothing was fitted."
    assert judge_drive(estimate(yaw=6.1), REFERENCE, RANGES[2], "Nothing was fitted.").word == "rejected"
