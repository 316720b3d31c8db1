"""The extrinsic that all frames' evidence and what is known already agree on, and how firmly."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from calibnet.alignment.evidence import Evidence
from calibnet.geometry.se3 import pose_from_vector

FIRMNESS = 15.0
"""Of a frame's evidence, beside half the squared standard deviations of what is known already: with it errors are as
large as the covariance says (docs/training.md)."""
MOST_ITERATIONS = 40
SPREAD = 0.5
"""Standard deviations to either side over which the curvature is measured: edges are rough at closer range."""


def align(
    evidence: Sequence[Evidence],
    known: NDArray[np.float64],
    covariance: NDArray[np.float64],
    start: NDArray[np.float64] | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Find the correction, and its covariance.

    Args:
        evidence: of the frames, all relative to one extrinsic.
        known: ``[6]``, correction ``(translation m, rotation vector rad)`` that is most likely without it.
        covariance: ``[6, 6]`` of that.
        start: ``[6]``, where to start; ``known`` by default.

    Returns:
        The most likely correction ``[6]``, and its covariance ``[6, 6]``, from the curvature there.
    """
    from scipy.optimize import minimize

    spread = np.linalg.cholesky(covariance)  # in units of standard deviations all parameters are alike

    def cost(deviations: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        correction = pose_from_vector(known + spread @ deviations)
        value, gradient = 0.5 * float(deviations @ deviations), np.zeros(6)
        for frame in evidence:
            more, slope = frame(correction)
            value, gradient = value + FIRMNESS * more, gradient + FIRMNESS * slope
        return value, deviations + spread.T @ gradient

    first = np.zeros(6) if start is None else np.linalg.solve(spread, start - known)
    options = {"maxiter": MOST_ITERATIONS, "gtol": 0.1}
    found = minimize(cost, first, jac=True, method="BFGS", options=options).x
    curvature = np.empty((6, 6))
    for axis, offset in enumerate(SPREAD * np.eye(6)):
        curvature[axis] = (cost(found + offset)[1] - cost(found - offset)[1]) / (2 * SPREAD)
    values, axes = np.linalg.eigh((curvature + curvature.T) / 2)
    firmer = spread @ axes / np.sqrt(np.maximum(values, 1.0))  # evidence never makes less firm
    return known + spread @ found, firmer @ firmer.T
