"""Reduces a cloud accumulated from several scans to what a single scan would have seen.

An accumulated cloud shows both sides of objects, what is hidden behind them, and everything that moved once per scan. A
camera sees none of this, and the networks were trained on single scans. Every scan leaves about as many points in a
direction, so the depth on which most of them agree is that of something static and visible: points in front of it
belong to moving objects, points behind it were hidden.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

SECTOR_DEG, SECTORS_APART_DEG = 1.0, 8.0
"""Width of the sectors that are examined to tell a cloud from a scan, and their spacing, in degrees."""
RAY_DEG = 0.1
"""Directions closer than this are one ray, along which a scanner has one echo."""
SHARED, BEHIND = 1.1, 0.008
"""Points per ray, and share of points behind another on their ray, from which a cloud is taken for several scans.
Single scans of our sensors have up to 1.06 of the former or 0.005 of the latter; three scans together have 1.14 and
0.01."""
VOTING_DEG = 0.5
"""Side of the cells that vote on their depth, in degrees: some rays wide, but small enough for one object."""
DEPTH_STEP = 1.1
"""Ratio of depths that count as different; within one step to either side they are the same."""
KEPT_DEG = 0.2
"""Side of the cells whose nearest point is kept, in degrees, which leaves about as many points as one scan has."""
NEARER_SHARE, NEARER_M = 1.1, 0.5
"""Ratio and distance by which a point must be farther to be behind another."""


class Directions(NamedTuple):
    """Directions and distances of points from a scanner at the origin: degrees, degrees and metres, ``[N]`` each."""

    azimuth: NDArray[np.float32]
    elevation: NDArray[np.float32]
    depth: NDArray[np.float32]

    @classmethod
    def of(cls, points: NDArray[np.float32]) -> Directions:
        """The directions of ``points [N, >=3]``."""
        x, y, z = points[:, :3].T
        across = np.hypot(x, y)
        return cls(np.degrees(np.arctan2(y, x)), np.degrees(np.arctan2(z, across)), np.hypot(across, z))

    def cells(self, side_deg: float, shift: float = 0.0) -> NDArray[np.int64]:
        """The index of each point's cell in a grid of azimuth and elevation, shifted by a share of a cell."""
        column, row = (np.floor((angle + 180) / side_deg + shift).astype(np.int64) for angle in self[:2])
        number: NDArray[np.int64] = column * int(360 / side_deg + 2) + row
        return number


def is_accumulated(points: NDArray[np.float32]) -> bool:
    """Whether a cloud ``[N, 4]`` is of more than one scan, with several points behind one another on a ray."""
    azimuth = np.degrees(np.arctan2(points[:, 1], points[:, 0]))
    directions = Directions.of(points[azimuth % SECTORS_APART_DEG < SECTOR_DEG])
    if not len(directions.depth):
        return False
    _, ray = np.unique(directions.cells(RAY_DEG), return_inverse=True)
    nearest = np.full(ray.max() + 1, np.inf, np.float32)
    np.minimum.at(nearest, ray, directions.depth)
    behind = directions.depth > NEARER_SHARE * nearest[ray] + NEARER_M
    return len(ray) > SHARED * len(nearest) and float(behind.mean()) > BEHIND


def as_one_scan(points: NDArray[np.float32]) -> NDArray[np.float32]:
    """The points of a cloud ``[N, 4]`` that one scan from the origin would have, in the same order.

    Cells vote twice, the second time shifted by half a cell, so that what is at the border of one is inside another.
    """
    for shift in (0.0, 0.5):
        directions = Directions.of(points)
        points = points[_with_most(directions.cells(VOTING_DEG, shift), directions.depth)]
    directions = Directions.of(points)
    near_to_far = np.argsort(directions.depth, kind="stable")
    _, nearest = np.unique(directions.cells(KEPT_DEG)[near_to_far], return_index=True)
    return points[np.sort(near_to_far[nearest])]


def _with_most(cell: NDArray[np.int64], depth: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Whether each point ``[N]`` is at the most frequent depth of its cell; the nearest one of equals counts."""
    step = np.floor(np.log(np.maximum(depth, NEARER_M)) / np.log(DEPTH_STEP)).astype(np.int64)
    step -= step.min() - 1
    most = int(step.max()) + 2  # so that neighbouring steps do not belong to another cell
    group, of_point, votes = np.unique(cell * most + step, return_inverse=True, return_counts=True)
    for_depth = votes.copy()
    for neighbour in (-1, 1):
        place = np.minimum(np.searchsorted(group, group + neighbour), len(group) - 1)
        for_depth += np.where(group[place] == group + neighbour, votes[place], 0)
    by_votes = np.lexsort((group, -for_depth, group // most))
    first = np.diff(group[by_votes] // most, prepend=-1) > 0
    elected = np.empty_like(group)
    elected[by_votes] = group[by_votes][first][np.cumsum(first) - 1]
    chosen: NDArray[np.bool_] = (np.abs(group - elected) <= 1)[of_point]
    return chosen
