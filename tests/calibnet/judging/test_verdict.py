from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from calibnet.geometry import RANGES, miscalibration
from calibnet.judging.classifier import Classifier
from calibnet.judging.coefficients import load_coefficients
from calibnet.judging.predictors import Predictors, misfits, predictors, reach
from calibnet.verdict import CAUSES, BadFrame, Cause, Tolerance, Verdict, moved
from calibnet.weights.manifest import load_manifest
from tests.support.drive import REFERENCE
from tests.support.matches import matches, run


def test_json_of_a_verdict() -> None:
    covariance = np.diag([0.03**2, 0, 0.04**2, 0, np.radians(0.2) ** 2, 0])
    cause = Cause("roll", "The image is rolled.", "7 px")
    verdict = Verdict(
        "rejected", "It does not fit.", REFERENCE, (2.0, 5.0), (cause,), covariance, 3, (BadFrame(7, "damaged"),)
    )
    said = json.loads(json.dumps(verdict.as_dict()))
    assert said["sigma"].pop("rotation_deg") == pytest.approx(0.2)
    assert said["sigma"].pop("translation_cm") == pytest.approx(5.0)
    assert said == {
        "verdict": "rejected",
        "reason": "It does not fit.",
        "causes": [{"name": "roll", "text": "The image is rolled.", "evidence": "7 px"}],
        "camera_from_lidar": REFERENCE.tolist(),
        "moved": {"rotation_deg": 2.0, "translation_cm": 5.0},
        "sigma": {"covariance": covariance.tolist()},
        "frames": {"used": 3, "skipped": [{"frame": 7, "why": "damaged"}]},
        "within": None,
        "advice": "",
    }
    coarse = replace(verdict, within=Tolerance(0.5, 15.0)).as_dict()["within"]
    assert coarse == {"rotation_deg": 0.5, "translation_cm": 15.0}
    assert Verdict("accepted", "", REFERENCE).as_dict()["sigma"] is None


def test_moved_is_what_pose_error_says() -> None:
    after = miscalibration([0, 0, 3], [0, 0, 0]) @ REFERENCE
    assert moved(REFERENCE, after)[0] == pytest.approx(3)


def test_the_axis_that_went_farthest_is_named_with_what_was_searched() -> None:
    along = reach(miscalibration([0, 0, 0], [0.1, 0, -4.5]) @ REFERENCE, REFERENCE, RANGES[2])
    assert along.share == pytest.approx(9)
    assert str(along) == "moved 4.5 m along the view, farther than the ±0.5 m searched"
    rolled = reach(miscalibration([20, 1, 2], [0, 0, 0]) @ REFERENCE, REFERENCE, RANGES[2])
    assert rolled.share == pytest.approx(4) and str(rolled) == "turned 20° in roll, farther than the ±5° searched"
    within = reach(miscalibration([1, 2, -4], [0.1, 0.2, 0.3]) @ REFERENCE, REFERENCE, RANGES[2])
    assert within.share == pytest.approx(0.8)


def test_predictors_of_a_run_that_fits_and_of_one_that_does_not() -> None:
    guess = miscalibration([1, 2, 3], [0.1, 0.2, -0.25]) @ REFERENCE
    fits = run(guess, REFERENCE, matches(np.eye(4), noise=0.5))
    found = predictors(fits)
    assert found.match_error == pytest.approx(np.log(1.5))
    bent = matches(np.eye(4), lambda places: places * (1 - 0.3 * (places**2).sum(axis=1, keepdims=True)), noise=0.5)
    wrong = predictors(run(guess, REFERENCE, bent))
    assert wrong.misfit > found.misfit + 0.5
    assert wrong.lens < -0.5 < -0.05 < found.lens <= 0
    curved = run(guess, REFERENCE, bent).stages[-1]
    (alone, bent), (fitting, _) = misfits(curved), misfits(fits.stages[-1])
    assert bent < 0.5 * alone and misfits(fits.stages[-1])[1] > 0.95 * fitting


def test_without_matches_the_predictor_is_missing_and_the_probability_is_not_a_number() -> None:
    trace = run(REFERENCE, REFERENCE)
    assert np.isnan(misfits(trace.stages[-1])).all()
    classifier = Classifier(0.0, {"misfit": 1.0}, 0.1, 0.9)
    assert np.isnan(classifier(predictors(trace)))


NOTHING = Predictors(*[0.0] * 4)


def test_the_classifier_is_a_logistic_regression() -> None:
    classifier = Classifier(1.0, {"misfit": 2.0, "match_error": -1.0}, 0.1, 0.9)
    assert classifier(replace(NOTHING, match_error=0.5, misfit=1.0)) == pytest.approx(1 / (1 + np.exp(-2.5)))


def test_the_coefficients_that_ship_belong_to_the_weights_that_ship_and_find_worse_results_likelier_wrong() -> None:
    coefficients = load_coefficients(load_manifest("compact"))
    assert coefficients.missing == "", "fit them again: calib-inspect fit-verdict"
    classifier = coefficients.frame
    assert classifier is not None and 0 < classifier.accepted_below < classifier.rejected_above <= 1
    good = Predictors(np.log(1.6), np.log(0.008), -0.02, np.log(2.0))
    bad = Predictors(1.6, -3.5, -0.2, np.log(5.0))
    assert classifier(good) < classifier.accepted_below < classifier(bad)
    assert coefficients.fitted["frames"]["false_accept_rate"] <= 0.01


def test_scripts_compare_the_names_of_causes_so_they_never_change() -> None:
    names = """focal-length principal-point distortion lens-model roll mirrored other-picture time-offset accumulated
        units axes left-handed bit-depth picture-size"""
    assert set(CAUSES) == set(names.split())
