"""The covariance of a pose whose matches have correlated errors.

Errors of the networks vary slowly over an image, so a thousand matches are not a thousand independent measurements.
The model here adds to the independent error of each match a polynomial of its position in the image, common to all
matches. Whatever such a polynomial can imitate (mostly a rotation; with a long lens or on a bare road also a
translation) is determined only to within the size of the polynomial.
"""

from __future__ import annotations

import numpy as np

from calibnet.geometry import PinholeCamera
from calibnet.geometry.types import Floats, Matrix6
from calibnet.judging.lens import INDEPENDENT, LEAST_SCALE_PX, view
from calibnet.trace import Matches

DEGREE = 3
"""Degree of the polynomial of the position, which is relative to the principal point, in half widths of the image."""
SIGMA_PX = 1.0
"""Standard deviation of each coefficient of the polynomial, in pixels of the stage's camera."""


def correlated_covariance(matches: Matches, camera: PinholeCamera, prior: Matrix6) -> Matrix6:
    """Covariance ``[6, 6]`` of ``(translation m, rotation rad)`` if matches have independent and common errors.

    Args:
        matches: of one look.
        camera: of the stage.
        prior: information ``[6, 6]`` about the pose before any match is used.
    """
    focal = np.array(camera.focal)
    scale = np.maximum(matches.scale.astype(np.float64), LEAST_SCALE_PX) / focal
    place, jacobian, ahead = view(matches.points.astype(np.float64), np.zeros(4), equidistant=False)
    weight = INDEPENDENT / scale**2 * ahead[:, None]
    terms = monomials(place * focal / (0.5 * camera.width))
    information = np.array(prior, np.float64)
    for axis in (0, 1):  # the polynomials of x and of y have nothing in common
        weighted = weight[:, axis, None] * jacobian[:, axis, :6]
        information += weighted.T @ jacobian[:, axis, :6]
        shared = terms.T @ (weight[:, axis, None] * terms) + np.eye(terms.shape[1]) * (focal[axis] / SIGMA_PX) ** 2
        both = weighted.T @ terms
        information -= both @ np.linalg.solve(shared, both.T)
    return np.asarray(np.linalg.inv(information), np.float64)


def monomials(place: Floats) -> Floats:
    """All products ``[N, K]`` of powers of x and y up to `DEGREE`, at places ``[N, 2]``."""
    x, y = place.T
    return np.stack([x**i * y**j for i in range(DEGREE + 1) for j in range(DEGREE + 1 - i)], axis=1)
