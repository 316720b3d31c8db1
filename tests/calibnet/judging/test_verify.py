"""Whether a given calibration is good: by offset, covariance and the estimate's own verdict."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calibnet.errors import CalibrationError, DatasetError
from calibnet.geometry import miscalibration
from calibnet.geometry.se3 import invert, pose_vector
from calibnet.geometry.types import Matrix6
from calibnet.judging.advice import CORRECT_IT, LOOK_AT_BOTH, NARROWER
from calibnet.judging.verify import (
    DRIVE,
    FRAME,
    Standard,
    named_cause,
    possible_errors,
    probability_within,
    unfit,
    verify,
)
from calibnet.verdict import DRIVE_LIMITS, DRIVE_TOLERANCES, BadFrame, Cause, Tolerance, Verdict
from tests.support.fakes import REFERENCE

MIRRORED = Cause("mirrored", "The image looks mirrored.", "1.2 px, not 7.1 px")


TIGHT, WIDE = Standard((Tolerance(0.3, 8.0),)), Standard((Tolerance(1.0, 25.0),))


def covariance(degrees: float, centimetres: float) -> Matrix6:
    """So much standard deviation on each axis."""
    return np.diag([*[(centimetres / 100) ** 2] * 3, *[np.radians(degrees) ** 2] * 3])


def found(degrees: float = 0.05, centimetres: float = 1.0) -> Verdict:
    return Verdict("accepted", "12 frames agree.", REFERENCE, covariance=covariance(degrees, centimetres), used=12)


def off(*, pitch: float = 0.0, yaw: float = 0.0, z: float = 0.0) -> np.ndarray:
    """The reference, off by so many degrees and metres."""
    return miscalibration([0.0, pitch, yaw], [0.0, 0.0, z]) @ REFERENCE


def test_a_calibration_that_is_off_is_rejected_with_axis_and_uncertainty() -> None:
    verdict = verify(off(yaw=2.7), found(0.1, 3.0), TIGHT)
    assert verdict.word == "rejected"
    assert verdict.reason.startswith("The calibration is off by 2.70° ± 0.20° (most of it yaw, +2.70°) and ")
    assert verdict.reason.endswith("the tolerance is 0.3° / 8 cm.")
    assert verdict.moved[0] == pytest.approx(2.7) and verdict.used == 12
    np.testing.assert_array_equal(verdict.camera_from_lidar, REFERENCE)  # where it should be


def test_a_shift_is_rejected_along_its_axis() -> None:
    verdict = verify(off(z=-0.3), found(0.05, 4.0), TIGHT)
    assert verdict.word == "rejected"
    assert "30.0 ± 7.8 cm (most of it z (ahead), -30.0 cm)" in verdict.reason
    assert verify(off(z=-0.15), found(0.05, 4.0), WIDE).word == "accepted"  # a frame tolerates 25 cm


@pytest.mark.parametrize(
    ("given", "sure", "word"),
    [
        (off(), (0.05, 1.0), "accepted"),
        (off(yaw=0.15, z=0.03), (0.05, 1.0), "accepted"),
        (off(), (0.05, 8.0), "cannot tell"),  # 8 cm on each axis: within 8 cm with 20 %
        (off(yaw=0.29), (0.05, 1.0), "cannot tell"),  # as likely beyond as within
        (off(z=0.12), (0.05, 4.0), "cannot tell"),  # beyond, at 3 sigma: chi-square 9, not 16.27
        (off(z=0.17), (0.05, 4.0), "rejected"),  # chi-square 18
        (off(yaw=0.2, z=0.1), (0.01, 8.0), "cannot tell"),  # a very sure turn does not make the shift sure
    ],
)
def test_the_word_follows_offset_and_certainty(given: np.ndarray, sure: tuple[float, float], word: str) -> None:
    assert verify(given, found(*sure), TIGHT).word == word


def test_the_probability_is_that_of_the_normal_distribution() -> None:
    """Three axes of 4 cm: within 8 cm with the chi distribution's 73.9 %; the rotation is sure."""
    inside = probability_within(possible_errors(covariance(0.001, 4.0)), TIGHT.tolerances[0])
    assert inside == pytest.approx(0.7385, abs=0.005)
    offset = pose_vector(off(z=0.08) @ invert(REFERENCE))
    errors = offset[:, None] + possible_errors(covariance(0.001, 0.01))
    assert probability_within(errors, TIGHT.tolerances[0]) == pytest.approx(0.5, abs=0.01)


def test_what_is_certain_takes_the_tails_from_the_probability() -> None:
    """Three axes of 8 cm: within 15 cm with 67.9 %, within 8 cm with 19.9 %."""
    fine, coarse = DRIVE_TOLERANCES
    shares = [probability_within(possible_errors(covariance(0.001, 8.0), coarse), one) for one in (fine, coarse)]
    assert shares == pytest.approx([0.199 / 0.679, 1.0], abs=0.01)


@pytest.mark.parametrize(
    ("given", "word", "end"),
    [
        (off(), "accepted", "no more than 0.5° / 15 cm: 0.00°"),
        (off(yaw=0.1, z=0.02), "accepted", "no more than 0.5° / 15 cm: 0.10°"),
        (off(z=0.1), "cannot tell", "within 0.5° / 15 cm is 73%."),
        (off(yaw=1.0), "rejected", "the tolerance is 0.5° / 15 cm."),
    ],
)
def test_a_result_that_is_certain_of_a_coarser_tolerance_judges_by_that_one(
    given: np.ndarray, word: str, end: str
) -> None:
    unsure = replace(found(0.1, 5.0), word="cannot tell", within=DRIVE_TOLERANCES[1])
    verdict = verify(given, unsure, DRIVE)
    assert verdict.word == word and end in verdict.reason
    assert verdict.within == (DRIVE_TOLERANCES[1] if word == "accepted" else None)
    assert verdict.advice == {"accepted": "", "cannot tell": NARROWER, "rejected": CORRECT_IT}[word]
    sure = verify(given, replace(unsure, within=DRIVE_LIMITS), DRIVE)  # its covariance resolves no finer one
    assert sure.word == word and sure.within == verdict.within


def test_what_is_not_accepted_itself_is_no_measure() -> None:
    rejected = replace(found(), word="rejected", reason="Image and scan do not fit together.")
    verdict = verify(off(), rejected, TIGHT)
    assert verdict.word == "cannot tell"
    assert verdict.reason.endswith("Image and scan do not fit together.")
    caused = verify(off(), replace(rejected, causes=(MIRRORED,)), TIGHT)
    assert (caused.word, caused.reason, caused.causes) == ("rejected", rejected.reason, (MIRRORED,))
    unsure = verify(off(), replace(rejected, word="cannot tell", causes=(MIRRORED,)), TIGHT)
    assert (unsure.word, unsure.causes) == ("cannot tell", (MIRRORED,))


def unsure(used: int = 5) -> Verdict:
    return replace(found(0.5, 15.0), word="cannot tell", reason="They agree on too little.", used=used)


@pytest.mark.parametrize(
    ("given", "of_drive", "word"),
    [
        (off(yaw=3.4), unsure(), "rejected"),
        (off(z=0.5), unsure(), "rejected"),
        (off(yaw=1.5, z=0.35), unsure(), "cannot tell"),  # results like it have been so far off, half as far again
        (off(yaw=3.4), unsure(used=3), "cannot tell"),  # of three frames nothing is known
        (off(yaw=3.4), replace(unsure(), word="rejected"), "rejected"),  # frames that fit agree, out of the range
        (off(yaw=3.4), replace(unsure(), skipped=(BadFrame(0, ""),) * 5), "cannot tell"),
    ],
)
def test_what_is_far_off_is_rejected_by_a_drive_that_is_not_sure_how_far(
    given: np.ndarray, of_drive: Verdict, word: str
) -> None:
    verdict = verify(given, of_drive, DRIVE)
    assert verdict.word == word and verdict.reason.endswith("They agree on too little.")
    assert verdict.advice == (LOOK_AT_BOTH if word == "rejected" else of_drive.advice)
    assert verify(given, of_drive, FRAME).word == "cannot tell", "a single frame may have gone anywhere"


def test_near_says_how_near_though_it_is_not_sure() -> None:
    reason = verify(off(yaw=0.2), unsure(), DRIVE).reason
    assert reason.startswith("The calibration differs by 0.2° and ") and "too uncertain to judge it by" in reason


def test_far_off_says_how_far() -> None:
    reason = verify(off(yaw=3.4), unsure(), DRIVE).reason
    assert reason.startswith("The calibration is off by about 3.4° and ")
    assert "or the input is wrong; the exact amount is uncertain." in reason


def test_without_covariance_nobody_can_tell() -> None:
    verdict = verify(off(yaw=3.0), replace(found(), covariance=None), WIDE)
    assert verdict.word == "cannot tell" and "3.00° / " in verdict.reason


def test_a_drive_whose_frames_mostly_do_not_fit_tells_nothing() -> None:
    skipped = tuple(BadFrame(frame, "It does not fit.") for frame in range(12))
    verdict = verify(off(), replace(found(), skipped=skipped), TIGHT)
    assert verdict.word == "cannot tell" and "12 of 24 frames" in verdict.reason
    assert verify(off(), replace(found(), skipped=skipped[:11]), TIGHT).word == "accepted"


def test_what_cannot_even_be_run_is_rejected_where_the_cause_is_known() -> None:
    assert unfit(REFERENCE, "No point falls into the image.").word == "cannot tell"
    verdict = unfit(REFERENCE, "The focal length is in millimetres.", (MIRRORED,))
    assert verdict.word == "rejected" and verdict.as_dict()["causes"] == [MIRRORED.as_dict()]


def test_an_error_may_name_its_cause() -> None:
    error = DatasetError("The focal length is in millimetres.")
    assert named_cause(error) == ()
    error.cause = "focal-length"  # type: ignore[attr-defined]
    again = CalibrationError("The focal length is in millimetres. It is in run.rrd.")
    again.__cause__ = error
    assert [cause.name for cause in named_cause(again)] == ["focal-length"]


def test_what_a_drive_and_a_frame_usually_state_is_sure_enough_to_accept_what_is_right() -> None:
    assert verify(off(), found(0.12, 3.5), DRIVE).word == "accepted", "0.2 degrees and 6 cm over the axes"
    assert verify(off(), found(0.35, 10.0), FRAME).word == "accepted", "0.6 degrees and 17 cm"


@pytest.mark.parametrize(
    ("given", "sure", "word", "end"),
    [
        (off(), (0.05, 2.0), "accepted", "no more than 0.3° / 8 cm: 0.00°"),  # sure enough for the finest
        (off(), (0.12, 3.5), "accepted", "no more than 0.5° / 15 cm: 0.00°"),
        (off(z=0.10), (0.05, 2.0), "rejected", "the tolerance is 0.3° / 8 cm."),  # what is sure finds less
        (
            off(z=0.09),
            (0.05, 2.6),
            "accepted",
            "no more than 0.5° / 15 cm: 0.00°",
        ),  # beyond 8 cm, but at 3.5 sigma only
        (off(z=0.14), (0.05, 3.5), "cannot tell", "within 0.5° / 15 cm is "),
    ],
)
def test_the_finest_tolerance_that_can_be_told_is_held_to(
    given: np.ndarray, sure: tuple[float, float], word: str, end: str
) -> None:
    verdict = verify(given, found(*sure), DRIVE)
    assert verdict.word == word and end in verdict.reason
