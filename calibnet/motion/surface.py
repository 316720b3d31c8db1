"""The depth of the scan at any pixel: a small plane through the nearest points in the image."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from calibnet.geometry.types import Floats

NEIGHBOURS, ENOUGH = 10, 5
"""Number of points that a plane is fitted to, and how many of them have to be near the pixel."""
NEAR, SMOOTH = 0.012, 0.005
"""Largest distance of these points from the pixel, and standard deviation of their weights, in widths of the image."""
FLATTEST = 0.1
"""Least standard deviation of the weighted points in any direction, in `SMOOTH`: those of one ring hold no plane."""
ROUGHEST, STEEPEST = 0.03, 0.35
"""Largest deviation from the plane, and largest range, of the points' inverse depths, relative to that of the pixel;
beyond these the pixel is at the edge of a surface."""
NEAREST_M, FARTHEST_M = 1.0, 80.0
"""Depths between which there is a surface."""


class Surface(NamedTuple):
    """Inverse depth ``[N]`` at pixels, in 1/m, and whether each is known."""

    inverse_depth: Floats
    known: NDArray[np.bool_]


def nearest_points(pixels: Floats, of_points: Floats) -> NDArray[np.int64]:
    """Rows ``[N, NEIGHBOURS]`` of the points at ``of_points [M, 2]`` nearest to pixels ``[N, 2]`` in the image.

    Raises:
        ValueError: there are fewer than `NEIGHBOURS` points.
    """
    from scipy.spatial import cKDTree

    if len(of_points) < NEIGHBOURS:
        raise ValueError(f"{len(of_points)} points are fewer than {NEIGHBOURS}.")
    return np.asarray(cKDTree(of_points).query(pixels, NEIGHBOURS)[1], np.int64)


def surface(pixels: Floats, of_points: Floats, depth: Floats, width: int) -> Surface:
    """The inverse depth at pixels, which is linear over the image of a plane.

    Args:
        pixels: ``[N, 2]``.
        of_points: ``[N, NEIGHBOURS, 2]``, pixels of the points around each.
        depth: ``[N, NEIGHBOURS]`` of these points, in metres.
        width: of the image.
    """
    offsets = (of_points - pixels[:, None]) / (SMOOTH * width)
    squared = (offsets**2).sum(axis=-1)
    weights = np.exp(-squared / 2) + 1e-9
    inverse = 1 / np.maximum(depth, NEAREST_M)
    terms = np.concatenate([np.ones_like(offsets[..., :1]), offsets], axis=-1)
    weighted = terms * weights[..., None]
    spread = _least_spread(offsets, weights)
    normal = weighted.swapaxes(1, 2) @ terms + np.diag([0.0, 1e-3, 1e-3])
    plane = np.linalg.solve(normal, (weighted.swapaxes(1, 2) @ inverse[..., None]))
    at_pixel = plane[:, 0, 0]
    rough = np.sqrt((weights * (inverse - (terms @ plane)[..., 0]) ** 2).sum(axis=1) / weights.sum(axis=1))
    near = np.sort(squared, axis=1)[:, ENOUGH - 1] < (NEAR / SMOOTH) ** 2
    smooth = (rough < ROUGHEST * at_pixel) & (np.ptp(inverse, axis=1) < STEEPEST * at_pixel)
    ahead = (depth > NEAREST_M).all(axis=1) & (at_pixel > 1 / FARTHEST_M)
    return Surface(at_pixel, near & smooth & ahead & (spread > FLATTEST**2))


def _least_spread(offsets: Floats, weights: Floats) -> Floats:
    """The least variance ``[N]``, over all directions, of weighted points ``[N, M, 2]``."""
    share = (weights / weights.sum(axis=1, keepdims=True))[..., None]
    about = offsets - (share * offsets).sum(axis=1, keepdims=True)
    scatter = (about * share).swapaxes(1, 2) @ about
    mean = (scatter[:, 0, 0] + scatter[:, 1, 1]) / 2
    half = (scatter[:, 0, 0] - scatter[:, 1, 1]) / 2
    return np.asarray(mean - np.hypot(half, scatter[:, 0, 1]))
