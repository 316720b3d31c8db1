"""Matches fitted with more than a pose: the focal length, principal point and lens that the camera may really have.

A wrong camera matrix lets matches fit under a pose that is not believable: a focal length that is too long looks like a
camera farther back. With the pose held near the guess by the range that was searched, fitting what else can be wrong
as well and comparing the costs tells which it is. The fit is the weighted Gauss-Newton of `calibnet.network.pose`,
with the same weights.
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
INDEPENDENT = 1 / 20
"""Share of matches that err independently: errors of neighbours are correlated over some twenty cells of a row."""
LEAST_SCALE_PX = 0.1
"""No match is known better than that, whatever the network expects."""


@dataclass(frozen=True)
class Lens:
    """What is fitted besides the pose.

    Attributes:
        name: of the cause, should it explain the matches.
        focal: a factor of the focal lengths.
        center: an offset of the principal point.
        radial: the first radial coefficient of distortion.
        equidistant: take the picture for that of an equidistant fisheye lens, with nothing to fit for it.
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
"""Standard deviations of what is fitted: of the focal length's logarithm, of the principal point in focal lengths
(x, y), and of the radial coefficient."""


@dataclass(frozen=True, eq=False)
class Fit:
    """Matches fitted by a pose and a lens.

    Attributes:
        lens: what was fitted.
        camera_from_lidar: 4x4.
        focal: factor of the focal lengths, true by believed.
        center: ``[2]`` offset of the principal point in pixels of the camera, true minus believed.
        radial: coefficient k1 of the picture.
        cost: of all residuals and of the distance from the guess: minus the logarithm of the likelihood.
        sigma: ``[P]`` standard deviations of the pose and of what was fitted besides, in `Lens`'s order.
    """

    lens: Lens
    camera_from_lidar: Extrinsic = field(repr=False)
    focal: float
    center: Floats
    radial: float
    cost: float
    sigma: Floats = field(repr=False)


def fit(
    matches: Matches, before: Extrinsic, camera: PinholeCamera, guess: Extrinsic, prior: Matrix6, lens: Lens = PINHOLE
) -> Fit:
    """Fit pose and lens to the matches of one look.

    Args:
        matches: of the look.
        before: ``camera_from_lidar`` that the look started from, 4x4.
        camera: of the stage that looked.
        guess: ``camera_from_lidar`` that the run started from.
        prior: information ``[6, 6]`` of the guess.
        lens: what to fit besides the pose.
    """
    points, scale = matches.points.astype(np.float64), np.maximum(matches.scale.astype(np.float64), LEAST_SCALE_PX)
    focal = np.array(camera.focal)
    target = points[:, :2] / points[:, 2:] + matches.displacement / focal  # in focal lengths from the principal point
    scale = scale / focal
    fitted = np.array([lens.focal, lens.center, lens.center, lens.radial])
    chosen = np.flatnonzero(np.concatenate([np.ones(6, bool), fitted]))
    information = np.zeros((10, 10))
    information[:6, :6] = prior
    information[6:, 6:] = np.diag(LENS_SIGMA**-2)
    information = information[np.ix_(chosen, chosen)]

    pose, extra = before @ invert(before), np.zeros(4)

    def residuals(pose: Extrinsic, extra: Floats) -> tuple[Floats, Floats, float]:
        seen, jacobian, ahead = view(transform_points(pose, points).astype(np.float64), extra, lens.equidistant)
        residual = target - seen
        size = np.sqrt(scale**2 + residual**2)
        weight = ahead[:, None] * INDEPENDENT / (scale * size)
        offset = np.concatenate([pose_vector(pose @ before @ invert(guess)), extra])[chosen]
        cost = INDEPENDENT * float((ahead[:, None] * (size / scale - 1)).sum()) + 0.5 * offset @ information @ offset
        weighted = jacobian[:, :, chosen] * weight[:, :, None]
        normal = np.einsum("nci,ncj->ij", weighted, jacobian[:, :, chosen]) + information
        return normal, np.einsum("nci,nc->i", weighted, residual) - information @ offset, cost

    normal, gradient, cost = residuals(pose, extra)
    for _ in range(ITERATIONS):
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
        if gained < 1e-3:
            break
    return Fit(
        lens,
        pose @ before,
        float(np.exp(extra[0])),
        extra[1:3] * focal,
        float(extra[3]),
        cost,
        np.sqrt(np.diag(np.linalg.inv(normal))),
    )


def view(moved: Floats, extra: Floats, equidistant: bool) -> tuple[Floats, Floats, Floats]:
    """Where points are seen, in focal lengths from the principal point.

    Args:
        moved: ``[N, 3]`` in the camera frame.
        extra: logarithm of the focal length's factor, offset of the principal point (x, y), radial coefficient.
        equidistant: the lens shows the angle from its axis, not the angle's tangent.

    Returns:
        Places ``[N, 2]``; their derivative ``[N, 2, 10]`` by a motion ``(translation, rotation)`` and by ``extra``; and
        1 for the points ahead ``[N]``, 0 for the others.
    """
    x, y, depth = moved.T
    inverse = 1 / np.maximum(depth, MINIMUM_DEPTH)
    x, y = x * inverse, y * inverse
    square = x * x + y * y
    radius = np.sqrt(np.maximum(square, 1e-12))
    bent, slope = np.ones_like(radius), np.zeros_like(radius)  # of the place, and its change by the squared radius
    if equidistant:
        bent = np.arctan(radius) / radius
        slope = (1 / (1 + square) - bent) / (2 * np.maximum(square, 1e-6))
    bent, slope = bent + extra[3] * square, slope + extra[3]
    factor = np.exp(extra[0])
    zero, one = np.zeros_like(x), np.ones_like(x)
    by_x = np.stack([inverse, zero, -x * inverse, -x * y, 1 + x * x, -y])
    by_y = np.stack([zero, inverse, -y * inverse, -1 - y * y, x * y, x])
    by_square = 2 * (x * by_x + y * by_y)
    jacobian = np.empty((len(x), 2, 10))
    for row, (place, by_pose) in enumerate(((x, by_x), (y, by_y))):
        jacobian[:, row, :6] = factor * (bent * by_pose + place * slope * by_square).T
        jacobian[:, row, 6] = factor * bent * place
        jacobian[:, row, 7 + row], jacobian[:, row, 8 - row] = one, zero
        jacobian[:, row, 9] = factor * place * square
    seen = factor * np.stack([x * bent, y * bent], axis=1) + extra[1:3]
    return seen, jacobian, (depth > MINIMUM_DEPTH).astype(np.float64)
