"""Multinomial logistic regression with a ridge penalty, and its predictions for sequences left out of the fit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import log_softmax

from calibnet.geometry.types import Floats


def regression(values: Floats, kinds: NDArray[np.integer], count: int, ridge: float) -> tuple[Floats, Floats]:
    """Fit the log odds of every kind relative to kind 0.

    Minimises the negative log likelihood plus ``ridge`` times the squared coefficients of all ``count`` kinds, on
    standardised predictors.

    Args:
        values: predictors ``[N, W]``.
        kinds: ``[N]``, kind of each row: 0 to ``count - 1``.
        count: number of kinds.
        ridge: weight of the penalty; between two kinds it amounts to half as much on the coefficients of their odds.

    Returns:
        Intercepts ``[K - 1]`` and coefficients ``[K - 1, W]``, in units of ``values``.
    """
    mean, deviation = values.mean(axis=0), np.maximum(values.std(axis=0), 1e-9)
    design = np.column_stack([np.ones(len(values)), (values - mean) / deviation])
    shape, target = (count, design.shape[1]), np.eye(count)[kinds]

    def cost(flat: Floats) -> tuple[float, Floats]:
        beta = flat.reshape(shape)
        logarithms = log_softmax(design @ beta.T, axis=1)
        penalised = beta * (np.arange(shape[1]) > 0)  # all but the intercepts
        gradient = (np.exp(logarithms) - target).T @ design + 2 * ridge * penalised
        return float(ridge * (penalised**2).sum() - (target * logarithms).sum()), gradient.ravel()

    beta = minimize(cost, np.zeros(count * shape[1]), jac=True, method="BFGS").x.reshape(shape)
    beta = beta[1:] - beta[0]
    weights = beta[:, 1:] / deviation
    return beta[:, 0] - weights @ mean, weights


def left_out(values: Floats, kinds: NDArray[np.integer], count: int, ridge: float, sequences: Sequence[str]) -> Floats:
    """Log odds ``[N, K - 1]`` of every row, from a `regression` on the rows of all other sequences."""
    odds, names = np.zeros((len(values), count - 1)), np.array(sequences)
    for name in dict.fromkeys(sequences):
        own = names == name
        others = ~own if len(set(sequences)) > 1 else own
        intercepts, weights = regression(values[others], kinds[others], count, ridge)
        odds[own] = values[own] @ weights.T + intercepts
    return odds
