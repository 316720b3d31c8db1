"""Fitting matches with more than a pose: also with another focal length, principal point or lens model.

With a wrong camera matrix matches fit an implausible pose: a focal length that is too long looks like a camera farther
back. The range of the stage is a prior that holds the pose near where the look started. Fitting one property of the
lens together with the pose, and comparing the costs, shows which property is wrong. The fit is the weighted
Gauss-Newton of `calibnet.network.pose`, with the same weights.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from calibnet.geometry import PinholeCamera
from calibnet.geometry.projection import MINIMUM_DEPTH
from calibnet.geometry.se3 import invert, pose_from_vector, pose_vector, transform_points
from calibnet.geometry.types import Extrinsic, Floats, Matrix6
from calibnet.trace import Matches

ITERATIONS = 12
SETTLED = 3e-4
"""Iterations stop when a step reduces the cost by less than this share: all further ones together would save less."""
INDEPENDENT = 1 / 20
"""Effective share of independent matches: errors of neighbours are correlated over some twenty cells of a row."""
LEAST_SCALE_PX = 0.1
"""Lower limit of a match's standard deviation in pixels, whatever the network expects."""


@dataclass(frozen=True)
class Lens:
    """What is fitted in addition to the pose.

    Attributes:
        name: name of the cause if this explains the matches.
        focal: fit a factor of the focal lengths.
        center: fit an offset of the principal point.
        radial: fit the first radial coefficient of distortion.
        equidistant: assume an equidistant fisheye lens, which has nothing to fit.
    """

    name: str
    focal: bool = False
    center: bool = False
    radial: bool = False
    equidistant: bool = False


PINHOLE = Lens("")
LENSES = (
    Lens("focal-length", focal=True),
    Lens("principal-point", center=True),
    Lens("distortion", radial=True),
    Lens("lens-model", equidistant=True),
)
"""What may be wrong with a camera's calibration, one at a time."""
LENS_SIGMA = np.array([0.1, 0.1, 0.1, 0.3])
"""Prior standard deviations of the logarithm of the focal length, of the principal point in focal lengths (x, y), and
of the radial coefficient."""


@dataclass(frozen=True, eq=False)
class Fit:
    """Matches fitted by a pose and a lens.

    Attributes:
        camera_from_lidar: 4x4.
        focal: fitted focal length relative to that of the calibration.
        center: ``[2]`` fitted principal point minus that of the calibration, in pixels.
        radial: fitted coefficient k1.
        cost: negative log posterior: all residuals, and the distance from where the look started.
    """

    camera_from_lidar: Extrinsic = field(repr=False)
    focal: float
    center: Floats
    radial: float
    cost: float


def fit(
    matches: Matches,
    before: Extrinsic,
    camera: PinholeCamera,
    prior: Matrix6,
    lens: Lens = PINHOLE,
    start: Fit | None = None,
) -> Fit:
    """Fit pose and lens to the matches of one look.

    Args:
        matches: of the look.
        before: ``camera_from_lidar`` that the look started from, 4x4.
        camera: of the stage.
        prior: information ``[6, 6]`` about ``before``.
        lens: what to fit in addition to the pose.
        start: another fit of the same matches, whose pose is the starting point; iterations stop as soon as they
            cannot get below its cost any more. None to start from ``before``.
    """
    points = matches.points.astype(np.float64)
    scale = np.maximum(matches.scale.T.astype(np.float64), LEAST_SCALE_PX)
    focal = np.array(camera.focal)
    target = ((points[:, :2] / points[:, 2:]) + matches.displacement / focal).T  # focal lengths from the centre
    scale = np.ascontiguousarray(scale / focal[:, None])
    fitted = np.array([lens.focal, lens.center, lens.center, lens.radial])
    chosen = np.flatnonzero(np.concatenate([np.ones(6, bool), fitted]))
    information = np.zeros((10, 10))
    information[:6, :6] = prior
    information[6:, 6:] = np.diag(LENS_SIGMA**-2)
    information = information[np.ix_(chosen, chosen)]

    pose, extra = np.eye(4) if start is None else start.camera_from_lidar @ invert(before), np.zeros(4)

    buffer = np.empty((10, 2, len(points)))

    def residuals(pose: Extrinsic, extra: Floats) -> tuple[Floats, Floats, float]:
        moved = transform_points(pose, points).astype(np.float64)
        seen, jacobian, ahead = view(moved, extra, lens.equidistant, buffer)
        residual = target - seen.T
        size = np.sqrt(scale**2 + residual**2)
        weight = ahead * INDEPENDENT / (scale * size)
        offset = np.concatenate([pose_vector(pose), extra])[chosen]
        cost = INDEPENDENT * float((ahead * (size / scale - 1)).sum()) + 0.5 * offset @ information @ offset
        derivatives = jacobian.T[chosen].reshape(len(chosen), -1)  # a row each, of x and then of y
        weighted = derivatives * weight.reshape(-1)
        return weighted @ derivatives.T + information, weighted @ residual.reshape(-1) - information @ offset, cost

    normal, gradient, cost = residuals(pose, extra)
    for left in reversed(range(ITERATIONS)):
        step = np.zeros(10)
        step[chosen] = np.linalg.solve(normal, gradient)
        for shorter in (1.0, 0.5, 0.1):  # a full step may overshoot where residuals are large
            further, more = pose_from_vector(shorter * step[:6]) @ pose, extra + shorter * step[6:]
            tried = residuals(further, more)
            if tried[2] <= cost:
                break
        else:
            break
        gained = cost - tried[2]
        pose, extra, (normal, gradient, cost) = further, more, tried
        if gained < SETTLED * cost or (start is not None and cost - gained * left > start.cost):
            break
    return Fit(pose @ before, float(np.exp(extra[0])), extra[1:3] * focal, float(extra[3]), cost)


def view(
    moved: Floats, extra: Floats, equidistant: bool, buffer: Floats | None = None
) -> tuple[Floats, Floats, Floats]:
    """Project points, in focal lengths from the principal point.

    Args:
        moved: ``[N, 3]`` in the camera frame.
        extra: logarithm of the focal length's factor, offset of the principal point (x, y), radial coefficient.
        equidistant: the distance from the principal point is the angle from the optical axis, not its tangent.
        buffer: ``[10, 2, N]`` to write the derivatives to, for repeated calls; allocated by default.

    Returns:
        Positions ``[N, 2]``; their derivatives ``[N, 2, 10]`` by a motion ``(translation, rotation)`` and by ``extra``;
        and ``[N]``, 1 for points in front of the camera, 0 for others.
    """
    depth = moved[:, 2]
    inverse = 1 / np.maximum(depth, MINIMUM_DEPTH)
    x, y = moved[:, 0] * inverse, moved[:, 1] * inverse
    square = x * x + y * y
    bent, slope = 1 + extra[3] * square, extra[3]  # of the place, and its change by the squared radius
    if equidistant:
        radius = np.sqrt(np.maximum(square, 1e-12))
        straight = np.arctan(radius) / radius
        bent = bent - 1 + straight
        slope = slope + (1 / (1 + square) - straight) / (2 * np.maximum(square, 1e-6))
    factor = np.exp(extra[0])
    jacobian = np.empty((10, 2, len(x))) if buffer is None else buffer
    crossed, zero = x * y, np.zeros_like(x)
    by_x = (inverse, zero, -x * inverse, -crossed, 1 + x * x, -y)
    by_y = (zero, inverse, -y * inverse, -1 - y * y, crossed, x)
    straight_lens = not equidistant and extra[3] == 0
    for column, (of_x, of_y) in enumerate(zip(by_x, by_y, strict=True)):
        if straight_lens:
            jacobian[column, 0], jacobian[column, 1] = factor * of_x, factor * of_y
            continue
        by_square = 2 * slope * (x * of_x + y * of_y)
        jacobian[column, 0] = factor * (bent * of_x + x * by_square)
        jacobian[column, 1] = factor * (bent * of_y + y * by_square)
    for row, place in enumerate((x, y)):
        jacobian[6, row] = factor * bent * place
        jacobian[7 + row, row], jacobian[8 - row, row] = 1.0, 0.0
        jacobian[9, row] = factor * place * square
    seen = factor * np.stack([x * bent, y * bent]) + extra[1:3, None]
    return seen.T, jacobian.T, (depth > MINIMUM_DEPTH).astype(np.float64)
