from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calibnet.evaluation import faults
from calibnet.geometry import RANGES, miscalibration, pose_error
from calibnet.geometry.types import Matrix6
from calibnet.judging.classifier import Classifier
from calibnet.judging.coefficients import Coefficients
from calibnet.judging.covariance import CovarianceModel, covariance
from calibnet.judging.judge import judge
from calibnet.trace import CascadeTrace
from calibnet.verdict import ACCEPTED, CANNOT_TELL, FRAME_LIMITS, FRAME_TOLERANCES, REJECTED
from tests.support.boxes import REFERENCE, boxes
from tests.support.matches import LENS_ODDS, matches, run

FRAME = boxes()
GUESS = miscalibration([1, 2, 3], [0.1, 0.2, -0.25]) @ REFERENCE
FITS = matches(np.eye(4), noise=0.3)


def fitted(classifier: Classifier) -> Coefficients:
    return Coefficients(classifier, lens=LENS_ODDS, weights={RANGES[4]: "0123"}, missing="")


CLASSIFIER = fitted(Classifier(0.0, {"match_error": 1.0}, accepted_below=0.6, rejected_above=0.8))
"""Of an error of less than 1.5 px and of more than 4 px."""


def test_what_fits_is_accepted_with_what_was_found() -> None:
    verdict = judge(FRAME, GUESS, run(GUESS, REFERENCE, FITS, match_error=1.2), CLASSIFIER)
    assert verdict.word == ACCEPTED and verdict.causes == ()
    assert verdict.reason == "Image and scan fit together."
    assert np.array_equal(verdict.camera_from_lidar, REFERENCE)
    away = pose_error(REFERENCE, GUESS)
    assert verdict.moved == (pytest.approx(away.rotation_deg), pytest.approx(away.translation_cm))
    assert verdict.covariance is not None and verdict.used == 1


def test_what_fits_less_well_cannot_be_told_and_then_is_rejected() -> None:
    words = [judge(FRAME, GUESS, run(GUESS, REFERENCE, FITS, error), CLASSIFIER).word for error in (1.4, 2.0, 4.2)]
    assert words == [ACCEPTED, CANNOT_TELL, REJECTED]


def test_what_is_not_accepted_may_be_certain_of_a_coarser_tolerance() -> None:
    finest = Classifier(0.0, {"match_error": 1.0}, accepted_below=0.6, rejected_above=0.65)
    both = fitted(replace(finest, coarser=replace(finest, intercept=-0.5)))
    verdicts = [judge(FRAME, GUESS, run(GUESS, REFERENCE, FITS, error), both) for error in (1.4, 2.0, 3.0)]
    assert [verdict.within for verdict in verdicts] == [FRAME_LIMITS, FRAME_TOLERANCES[1], None]
    assert [verdict.word for verdict in verdicts] == [ACCEPTED, CANNOT_TELL, REJECTED]
    assert "the result is within 1.5° / 40 cm, but perhaps not within 1° / 25 cm" in verdicts[1].reason
    bent = run(GUESS, REFERENCE, matches(np.eye(4), lambda places: 0.96 * places, noise=0.5), match_error=2.0)
    named = judge(FRAME, GUESS, bent, both, match_error=lambda frame, guess: 1.0)
    assert named.within is None and [cause.name for cause in named.causes] == ["focal-length"]
    assert "the result is within" not in named.reason


def test_what_is_known_beforehand_is_never_rejected_by_the_classifier_alone() -> None:
    """It was fitted to runs whose axes are all open; what speaks against image and scan does so as ever."""
    fixed = "x, y, z fixed"
    verdicts = [
        judge(FRAME, GUESS, run(GUESS, REFERENCE, FITS, error), CLASSIFIER, prior=fixed) for error in (1.4, 2.0, 4.2)
    ]
    assert [verdict.word for verdict in verdicts] == [ACCEPTED, CANNOT_TELL, CANNOT_TELL]
    assert "81% without prior knowledge, less with x, y, z fixed" in verdicts[2].reason
    lost = judge(FRAME, GUESS, run(GUESS, REFERENCE, FITS, match_error=9.0), CLASSIFIER, prior=fixed)
    assert lost.word == REJECTED


def test_a_trace_without_matches_cannot_be_told() -> None:
    verdict = judge(
        FRAME, GUESS, run(GUESS, REFERENCE, None, match_error=1.2), fitted(Classifier(0.0, {"misfit": 1.0}, 0.6, 0.8))
    )
    assert verdict.word == CANNOT_TELL and "too little information" in verdict.reason


def test_by_coefficients_of_no_or_of_other_stages_nothing_is_accepted() -> None:
    trace = run(GUESS, REFERENCE, FITS, match_error=1.2)
    unfit = judge(FRAME, GUESS, trace, Coefficients(missing="Other weights; fit it."))
    assert unfit.word == CANNOT_TELL and unfit.reason.endswith("cannot be judged. Other weights; fit it.")
    short = judge(FRAME, GUESS, replace(trace, stages=trace.stages[:2]), CLASSIFIER)
    assert short.word == CANNOT_TELL and "that end with the stage of ±1°/0.1 m, not with ±2°/0.2 m" in short.reason
    lost = judge(FRAME, GUESS, run(GUESS, REFERENCE, FITS, match_error=9.0), Coefficients())
    assert lost.word == REJECTED, "that needs no coefficients"


def test_matches_beyond_the_limit_are_rejected_and_the_cause_is_looked_for() -> None:
    trace = run(GUESS, REFERENCE, FITS, match_error=9.0)
    verdict = judge(FRAME, GUESS, trace, CLASSIFIER)
    assert verdict.word == REJECTED and verdict.causes == ()
    assert verdict.reason.endswith("the expected match error is 9.0 px, where at most 5.5 px is usual.")
    last = trace.stages[-1]
    small = replace(
        trace,
        stages=(
            *trace.stages[:-1],
            replace(last, camera=last.camera.resized(FRAME.camera.width // 2, FRAME.camera.height // 2)),
        ),
    )
    assert "error is 18.0 px, where at most 11.0 px" in judge(FRAME, GUESS, small, CLASSIFIER).reason, "of the image"
    assert np.array_equal(verdict.camera_from_lidar, REFERENCE)

    upright = judge(FRAME, GUESS, trace, CLASSIFIER, match_error=lambda frame, guess: 30.0 if frame is FRAME else 29.0)
    assert [cause.name for cause in upright.causes] == ["other-picture"]
    mirror = faults.mirrored(FRAME)
    known = judge(
        mirror,
        GUESS,
        trace,
        CLASSIFIER,
        match_error=lambda frame, guess: 8.0 if np.array_equal(frame.image, FRAME.image) else 30.0,
    )
    assert [cause.name for cause in known.causes] == ["mirrored", "left-handed"]
    assert known.reason.endswith("The image is mirrored, or the scan's axes are left-handed.")


def test_who_goes_beyond_the_range_searched_is_rejected_and_by_how_much_is_said() -> None:
    far = miscalibration([0, 0, 0], [0, 0, 4.5]) @ REFERENCE
    verdict = judge(FRAME, GUESS, run(REFERENCE, far, FITS, match_error=1.2), CLASSIFIER)
    assert verdict.word == REJECTED
    assert verdict.reason == "The LiDAR moved 4.5 m along the view, farther than the ±0.5 m searched."
    assert verdict.advice.startswith("If the start may be that far off, run all stages (--stages 1-5)")
    near = miscalibration([0, 0, 0], [0, 0.7, 0]) @ REFERENCE
    unsure = judge(FRAME, GUESS, run(REFERENCE, near, FITS, match_error=1.2), CLASSIFIER)
    assert unsure.word == CANNOT_TELL and "0.7 m along the image's height" in unsure.reason
    bent = matches(np.eye(4), lambda places: 0.96 * places, noise=0.5)
    trace = run(REFERENCE, far, bent, match_error=1.2)
    assert judge(FRAME, GUESS, trace, CLASSIFIER).causes == (), "why is not asked"
    named = judge(FRAME, GUESS, trace, CLASSIFIER, match_error=lambda frame, guess: 1.0)
    assert [cause.name for cause in named.causes] == ["focal-length"] and "shorter than camera_matrix" in named.reason
    assert named.advice == "", "the cause says what to do"


def test_implausible_input_is_rejected_however_well_it_fits() -> None:
    trace = run(GUESS, REFERENCE, FITS, match_error=1.2)
    verdict = judge(faults.matrix_of_size(0.5)(FRAME), GUESS, trace, CLASSIFIER)
    assert verdict.word == REJECTED and [cause.name for cause in verdict.causes] == ["picture-size"]
    blank = replace(FRAME, image=np.full_like(FRAME.image, 128))
    assert judge(blank, GUESS, trace, CLASSIFIER).reason == "The image is blank."
    upper_bits_lost = replace(FRAME, image=FRAME.image >> 6)  # hardly anything is left, and that is why
    assert [one.name for one in judge(upper_bits_lost, GUESS, trace, CLASSIFIER).causes] == ["bit-depth"]


def test_what_could_not_be_run_is_rejected_where_it_started() -> None:
    verdict = judge(faults.scaled_scan(1000.0)(FRAME), GUESS, None, CLASSIFIER)
    assert verdict.word == REJECTED and [cause.name for cause in verdict.causes] == ["units"]
    assert np.array_equal(verdict.camera_from_lidar, GUESS) and verdict.moved == (0.0, 0.0)
    assert verdict.covariance is None


def test_a_covariance_grows_with_the_match_error_and_with_fewer_matches() -> None:
    sharp, blunt = (run(GUESS, REFERENCE, FITS, error) for error in (1.0, 3.0))
    variances = [np.diag(covariance(trace, CovarianceModel())) for trace in (sharp, blunt)]
    assert (variances[1] > variances[0]).all()

    def stating(information: Matrix6 | None) -> CascadeTrace:
        return replace(sharp, stages=(*sharp.stages[:2], replace(sharp.stages[2], information=information)))

    # without matches nothing is known but the range that was searched
    few = covariance(
        stating(sharp.stages[2].range.information), CovarianceModel(common_translation_m=0, common_rotation_deg=0)
    )
    np.testing.assert_allclose(few, np.linalg.inv(RANGES[2].information))
    assert covariance(stating(None), CovarianceModel()) is None
