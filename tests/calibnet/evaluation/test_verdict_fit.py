"""From runs of a known truth to coefficients, on runs that follow known ones."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

from calibnet.errors import CalibrationError
from calibnet.evaluation.verdict_fit import (
    fit_classifier,
    fit_covariance,
    fit_drives,
    fit_frames,
    is_near,
    nees_of,
    threshold,
)
from calibnet.evaluation.verdict_runs import VerdictRun
from calibnet.geometry import RANGES
from calibnet.judging.covariance import CovarianceModel
from calibnet.judging.predictors import Predictors

NAMES = tuple(one.name for one in fields(Predictors))
LAST = RANGES[4]
BOTH = (LAST, RANGES[2])
STATED = np.diag([4e3, 4e3, 1e3, 4e5, 4e5, 4e5]) + LAST.information


def runs(count: int, spread: CovarianceModel, seed: int = 0, sharpness: float = 3.0) -> list[VerdictRun]:
    """Results that lie as far off as a spread says, whose match error tells, more or less sharply, which are wrong."""
    generator, made = np.random.default_rng(seed), []
    for number in range(count):
        error = float(generator.uniform(1, 4))
        wrong = generator.random() < 1 / (1 + np.exp(-sharpness * (error - 2.5)))
        offset = generator.multivariate_normal(np.zeros(6), spread.covariance(STATED, *BOTH, error))
        said = {name: float(generator.normal()) for name in NAMES} | {"match_error": error}
        made.append(
            VerdictRun(
                number, f"drive {number % 7}", number, "none" if number % 2 else "grey", "", 2.0 if wrong else 0.3, 9.0,
                not wrong, said, offset.tolist(), STATED.tolist(), error,
            )
        )  # fmt: skip
    return made


def test_the_predictor_that_tells_is_found_and_the_others_are_not_believed() -> None:
    classifier, _, figures = fit_frames(runs(800, CovarianceModel()), BOTH)
    assert classifier.weights["match_error"] == pytest.approx(3.0, abs=0.5)
    assert max(abs(weight) for name, weight in classifier.weights.items() if name != "match_error") < 0.4
    assert -classifier.intercept / classifier.weights["match_error"] == pytest.approx(2.5, abs=0.15)
    assert (figures.runs, figures.plain, figures.sequences) == (800, 400, 7)
    assert figures.false_accept_rate == 4 / 800  # as many as may be, and no more
    assert 0.2 < figures.acceptance_of_good < 0.8 < 1 - classifier.accepted_below < 1
    shares = [point["acceptance_of_good"] for point in figures.curve]
    assert shares == sorted(shares) and shares[0] < shares[-1] and figures.curve[2]["false_accepts"] == 0.005
    assert shares[2] == figures.acceptance_of_good


def test_runs_near_a_limit_are_set_aside_in_a_curve_of_their_own() -> None:
    """Half of the wrong ones are off by a tenth of the limit, and are those that look best."""
    made = [
        replace(run, translation_cm=27.5, rotation_deg=0.3, predictors={**(run.predictors or {}), "match_error": 1.0})
        if not run.good and run.number % 2
        else run
        for run in runs(800, CovarianceModel())
    ]
    _, _, figures = fit_frames(made, BOTH)
    at_one = figures.curve[3]
    assert 4 * at_one["acceptance_of_good"] < at_one["acceptance_of_clear"]
    assert is_near(replace(made[0], rotation_deg=0.3), (0.25, 99.0)) and not is_near(made[0], (9.0, 99.0))


def test_runs_near_a_limit_and_others_have_bounds_of_their_own() -> None:
    """Some wrong runs look best of all, and end near a limit: how many of them may pass decides what is accepted."""
    made = [
        replace(run, translation_cm=27.5, rotation_deg=0.3, predictors={**(run.predictors or {}), "match_error": 1.0})
        if not run.good and run.number % 40 == 1
        else run
        for run in runs(800, CovarianceModel())
    ]
    strict, lenient = (fit_classifier(made, (1.0, 25.0), most, clear_false_accepts=0.01) for most in (0.01, 1.0))
    assert strict[0].accepted_below < lenient[0].accepted_below
    assert strict[1].false_accept_rate <= 0.01 < lenient[1].false_accept_rate < 0.03
    assert strict[1].acceptance_of_good < lenient[1].acceptance_of_good


def test_what_predictors_do_not_tell_is_not_accepted() -> None:
    classifier, _, figures = fit_frames(runs(800, CovarianceModel(), sharpness=0.0), BOTH)
    assert figures.acceptance_of_good < 0.1 and classifier.accepted_below < 0.5


def test_a_threshold_lets_so_many_wrong_ones_through() -> None:
    odds, wrong = np.array([-3.0, -2, -1, 0, 1, 2]), np.array([False, True, False, True, False, True])
    assert [threshold(odds, wrong, most) for most in (0, 1, 1.9, 2, 3)] == [-2, 0, 0, 2, np.inf]


@pytest.mark.parametrize("spread", [CovarianceModel(0.05, 0.07, 0.4), CovarianceModel(0.5, 0.02, 0.1)])
def test_the_spread_is_found_and_covers_the_errors(spread: CovarianceModel) -> None:
    made = runs(400, spread)
    found = fit_covariance(made, BOTH)
    assert nees_of(made, BOTH, found) == pytest.approx(1.0, abs=0.05)
    truth, estimate = (of.covariance(STATED, *BOTH, 2.0) for of in (spread, found))
    np.testing.assert_allclose(np.sqrt(np.diag(estimate)), np.sqrt(np.diag(truth)), rtol=0.15)
    assert fit_covariance(made[:5], BOTH) == CovarianceModel()


def test_too_few_runs_of_a_kind_are_a_sentence() -> None:
    few = [run for run in runs(200, CovarianceModel()) if run.good][:40]
    with pytest.raises(CalibrationError, match="Of 40 runs 40 are right and 0 wrong"):
        fit_frames(few, BOTH)


def test_a_drive_s_covariance_is_widened_to_its_errors() -> None:
    made = [
        replace(
            run,
            information=np.linalg.inv(CovarianceModel().covariance(STATED, *BOTH, run.match_error_px) / 4).tolist(),
            predictors={"match_error": (run.predictors or {})["match_error"], "aligned": 0.0, "lens": 0.0},
        )
        for run in runs(400, CovarianceModel())
    ]
    classifier, inflation, figures = fit_drives(made)
    assert inflation == pytest.approx(4.0, rel=0.15) and figures.nees == pytest.approx(1.0, abs=1e-4)
    assert classifier.weights["match_error"] > 1 and set(classifier.weights) == {"match_error", "aligned", "lens"}
