"""Multinomial logistic regression: known coefficients are found, and a left-out sequence does not count."""

from __future__ import annotations

import numpy as np
import pytest

from calibnet.evaluation.logistic import left_out, regression

INTERCEPTS, WEIGHTS = np.array([0.5, -1.0]), np.array([[2.0, 0.0], [-1.0, 1.5]])


def drawn(count: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Predictors ``[N, 2]`` and kinds ``[N]`` of three, drawn with the log odds above."""
    generator = np.random.default_rng(seed)
    values = generator.normal(size=(count, 2))
    odds = np.column_stack([np.zeros(count), values @ WEIGHTS.T + INTERCEPTS])
    return values, (odds + generator.gumbel(size=odds.shape)).argmax(axis=1)


def test_the_coefficients_that_kinds_were_drawn_with_are_found_in_the_predictors_own_units() -> None:
    values, kinds = drawn(40_000)
    units, offset = np.array([100.0, 0.01]), np.array([3.0, -2.0])
    intercepts, weights = regression(values * units + offset, kinds, 3, ridge=1e-3)
    assert weights * units == pytest.approx(WEIGHTS, abs=0.08)
    assert intercepts + weights @ offset == pytest.approx(INTERCEPTS, abs=0.08)


def test_a_larger_penalty_draws_coefficients_to_zero_and_leaves_the_shares() -> None:
    values, kinds = drawn(2_000)
    intercepts, weights = regression(values, kinds, 3, ridge=1e7)
    assert np.abs(weights).max() < 1e-3
    shares = np.bincount(kinds) / len(kinds)
    assert intercepts == pytest.approx(np.log(shares[1:] / shares[0]), abs=1e-2)


def test_each_sequence_is_judged_by_a_fit_to_the_others() -> None:
    values = np.random.default_rng(0).normal(size=(40, 1))
    kinds = (values[:, 0] > 0).astype(np.intp)
    kinds[20:] = 1 - kinds[20:]  # the other way round in one of them: a fit to its own runs would know
    odds = left_out(values, kinds, 2, 6.0, ["a"] * 20 + ["b"] * 20)
    assert np.mean((odds[:, 0] > 0) == kinds) < 0.1
    intercepts, weights = regression(values[:20], kinds[:20], 2, 6.0)
    np.testing.assert_allclose(odds[20:], intercepts + values[20:] @ weights.T, atol=1e-6)
