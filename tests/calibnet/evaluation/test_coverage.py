"""Coverage of stated covariances, by errors drawn from known ones."""

from __future__ import annotations

import numpy as np
import pytest

from calibnet.evaluation.coverage import Coverage, squared_error
from calibnet.geometry.se3 import pose_from_vector
from tests.support.drive import REFERENCE

COVARIANCE = np.diag([0.03, 0.04, 0.1, *np.radians([0.2, 0.2, 0.3])]) ** 2


def squares(widened: float) -> list[float]:
    """Of results that err as much more than they state, in standard deviations."""
    draws = np.random.default_rng(0).multivariate_normal(np.zeros(6), widened**2 * COVARIANCE, 2000)
    return [squared_error(pose_from_vector(draw) @ REFERENCE, REFERENCE, COVARIANCE) for draw in draws]


def test_a_covariance_that_is_right_about_itself() -> None:
    coverage = Coverage.of(squares(1.0))
    assert coverage is not None and coverage.runs == 2000
    assert coverage.squared == pytest.approx(1.0, abs=0.03) and coverage.squared_error == pytest.approx(
        0.013, abs=0.002
    )
    assert coverage.median == pytest.approx(1.0, abs=0.05) and coverage.within == pytest.approx(0.95, abs=0.015)


def test_one_that_is_too_small() -> None:
    coverage = Coverage.of(squares(2.0))
    assert coverage is not None and coverage.squared == pytest.approx(4.0, abs=0.15) and coverage.within < 0.6
    assert str(coverage).startswith("squared error 3.99 ± 0.05 per degree of freedom") and "2000 runs" in str(coverage)


def test_nothing_stated_says_nothing_and_one_run_says_little() -> None:
    assert Coverage.of([squared_error(REFERENCE, REFERENCE, None)]) is None
    lone = Coverage.of([6.0])
    assert lone is not None and lone.as_dict()["squared"] == 1.0 and lone.as_dict()["squared_error"] is None
    assert str(lone) == "squared error 1.00 per degree of freedom, within the 95 % region, 1 run"
