"""The median of several extrinsics of one mount, which is robust against up to half of them being outliers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from calibnet.geometry.se3 import rotation_from_vector, rotation_vector, transform
from calibnet.geometry.types import Extrinsic, Floats, Rotation

ITERATIONS = 200
"""Largest number of iterations; Weiszfeld's iteration mostly converges within a few dozen."""
SETTLED = 1e-13
"""Change of the median, in the points' unit, below which it has converged."""
SMOOTHING = 1e-4
"""Smallest distance in a point's weight, relative to the median distance, since the weight is infinite at the point."""
SMALLEST = 1e-12
"""Smallest distance in a point's weight if all points are the same, in their unit."""
RECENTRINGS = 3
"""Iterations in which rotation vectors are taken relative to the current median, about which they are distances."""


def median_pose(extrinsics: Sequence[Extrinsic]) -> Extrinsic:
    """The pose with the smallest sum of distances, of angles and of translations, to all of them.

    Args:
        extrinsics: one or more 4x4 transforms between the same two frames.

    Returns:
        4x4; its rotation is the geodesic L1 median, its translation the geometric median.

    Raises:
        ValueError: there are no extrinsics.
    """
    if not extrinsics:
        raise ValueError("There are no extrinsics to take the median of.")
    stack = np.array(extrinsics)
    rotation: Rotation = stack[0, :3, :3]
    for _ in range(RECENTRINGS):
        vectors = np.array([rotation_vector(other @ rotation.T) for other in stack[:, :3, :3]])
        rotation = rotation_from_vector(geometric_median(vectors)) @ rotation
    return transform(rotation, geometric_median(stack[:, :3, 3]))


def geometric_median(points: Floats) -> Floats:
    """Weiszfeld's iteration: the point with the smallest sum of distances to ``points`` ``[N, K]``."""
    middle: Floats = np.median(points, axis=0)
    distances = np.linalg.norm(points - middle, axis=1)
    smallest = max(SMOOTHING * float(np.median(distances)), SMALLEST)
    for _ in range(ITERATIONS):
        pulls = 1.0 / np.hypot(np.linalg.norm(points - middle, axis=1), smallest)
        moved: Floats = (pulls[:, None] / pulls.sum() * points).sum(axis=0)
        if np.linalg.norm(moved - middle) < SETTLED:
            break
        middle = moved
    return middle
