"""Sparse nonlinear least squares for the adjustment: Levenberg-Marquardt, robust, with sparse normal equations.

`scipy.optimize.least_squares` uses inexact inner steps for a sparse Jacobian, and stops far from the minimum if all
residuals depend on a few common parameters, such as an extrinsic.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calibnet.geometry.types import Floats

Columns = list[list[tuple[NDArray[np.int64], NDArray[np.int64]]]]
"""Groups of parameters that no residual shares, which are differentiated together: the index of each parameter, once
for each residual that it moves, and the rows of these."""

MOST_STEPS = 20
STILL = 1e-6
"""Relative gain of the cost below which the search ends."""
STEP = 1e-6
"""Step of the numerical derivatives, in the units of the parameters: metres, radians, shares, and pixels."""


@dataclass(frozen=True, eq=False)
class Solution:
    """The minimum of the cost.

    Attributes:
        x: the parameters.
        normal: sparse ``J^T W J`` at the start of the last step, which hardly changed anything.
        cost: sum of the robust losses.
    """

    x: Floats = field(repr=False)
    normal: Any = field(repr=False)
    cost: float


def solve(
    residuals: Callable[[Floats], Floats],
    start: Floats,
    columns: Columns,
) -> Solution:
    """Minimise residuals under the robust loss ``2 (sqrt(1 + r^2) - 1)``.

    Args:
        residuals: function from parameters to residuals.
        start: initial parameters.
        columns: which residuals each parameter moves.
    """
    from scipy.sparse import csc_matrix, diags
    from scipy.sparse.linalg import splu

    x, damping = start.copy(), 1e-4
    r = residuals(x)
    cost = _cost(r)
    normal = csc_matrix((len(x), len(x)))
    for _ in range(MOST_STEPS):
        jacobian = _jacobian(residuals, x, r, columns)
        weights = 1 / np.sqrt(1 + r**2)
        weighted = diags(weights) @ jacobian
        normal, gradient = (jacobian.T @ weighted).tocsc(), weighted.T @ r
        gain = 0.0
        for _ in range(8):
            damped = normal + damping * diags(normal.diagonal() + 1e-9)
            moved = x - splu(damped.tocsc()).solve(gradient)
            tried = residuals(moved)
            if _cost(tried) < cost:
                gain = cost - _cost(tried)
                x, r, cost, damping = moved, tried, _cost(tried), damping / 10
                break
            damping *= 10
        if gain <= STILL * max(cost, 1e-9):
            break
    return Solution(x, normal, cost)


def _cost(r: Floats) -> float:
    return float((2 * (np.sqrt(1 + r**2) - 1)).sum())


def _jacobian(
    residuals: Callable[[Floats], Floats],
    x: Floats,
    r: Floats,
    columns: Columns,
) -> Any:
    from scipy.sparse import csr_matrix

    values, rows, places = [], [], []
    for group in columns:
        moved = x.copy()
        for parameters, _ in group:
            moved[np.unique(parameters)] += STEP
        change = (residuals(moved) - r) / STEP
        for parameters, affected in group:
            values.append(change[affected])
            rows.append(affected)
            places.append(parameters)
    cells = (np.concatenate(rows), np.concatenate(places))
    return csr_matrix((np.concatenate(values), cells), shape=(len(r), len(x)))
