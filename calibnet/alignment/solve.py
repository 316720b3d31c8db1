"""Combines the evidence of all frames with the estimate so far, and says how certain the result is."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from calibnet.alignment.evidence import Evidence
from calibnet.geometry.se3 import pose_from_vector, rotation_jacobian
from calibnet.geometry.types import Matrix6, Vector6

FIRMNESS = 15.0
"""Weight of a frame's evidence in the cost, in which the estimate so far counts half its squared deviation in standard
deviations. With it, errors are about as large as the covariance says (docs/decisions.md, "The firmness of the
evidence")."""
MOST_FRAMES = 8
"""Number of frames up to which evidence adds up. More count no more than these, since frames of one drive err alike."""
MOST_ITERATIONS = 40
STEP = 0.5
"""Step, in standard deviations to either side, over which curvature is measured: at closer range edges are rough."""


def align(
    evidence: Sequence[Evidence],
    known: Vector6,
    covariance: Matrix6,
    starts: Sequence[Vector6] = (),
) -> tuple[Vector6, Matrix6]:
    """Find the correction, and its covariance.

    Args:
        evidence: of the frames, all relative to one extrinsic.
        known: ``[6]``, the most likely correction ``(translation m, rotation vector rad)`` without this evidence.
        covariance: ``[6, 6]``, covariance of ``known``.
        starts: corrections ``[6]`` to start from; the best result is taken. By default ``known``.

    Returns:
        The most likely correction ``[6]``, and its covariance ``[6, 6]`` from the curvature there.
    """
    from scipy.optimize import minimize

    everything = Evidence(tuple(evidence))
    deviation = np.linalg.cholesky(covariance)  # in standard deviations all parameters have the same scale
    firmness = FIRMNESS * min(1.0, MOST_FRAMES / max(1, len(evidence)))

    def cost(deviations: Vector6) -> tuple[float, Vector6]:
        vector = known + deviation @ deviations
        value, gradient = everything(pose_from_vector(vector))
        gradient[3:] = rotation_jacobian(vector[3:]).T @ gradient[3:]  # by the vector itself, not by a further rotation
        return 0.5 * float(deviations @ deviations) + firmness * value, deviations + firmness * deviation.T @ gradient

    options = {"maxiter": MOST_ITERATIONS, "gtol": 0.05}
    offsets = [np.linalg.solve(deviation, start - known) for start in starts or [known]]
    results = [minimize(cost, offset, jac=True, method="BFGS", options=options) for offset in offsets]
    found = min(results, key=lambda result: float(result.fun)).x
    curvature = np.empty((6, 6))
    for axis, offset in enumerate(STEP * np.eye(6)):
        curvature[axis] = (cost(found + offset)[1] - cost(found - offset)[1]) / (2 * STEP)
    values, axes = np.linalg.eigh((curvature + curvature.T) / 2)
    firmer = deviation @ axes / np.sqrt(np.maximum(values, 1.0))  # evidence never makes it less certain
    return known + deviation @ found, firmer @ firmer.T
