"""The map of all scans of a drive, as small planes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from calibnet.geometry.se3 import transform_points
from calibnet.geometry.types import Floats, Transform

VOXEL_M = 0.15
"""Side of the voxels that keep one point of the map each, in metres."""
FARTHEST_M = 50.0
"""Largest distance of the map's points from the scanner, in metres: farther away, scans are too sparse for planes."""
NEIGHBOURS = 12
WIDEST_M = 0.8
"""Largest distance to the farthest neighbour of a plane, in metres: sparser points are no surface."""
FLATTEST = 0.05
"""Largest variance of neighbours across their plane, relative to that along its narrower side."""


@dataclass(frozen=True, eq=False)
class Planes:
    """Points of the map with a plane around each.

    Attributes:
        points: ``[N, 3]`` metres, in the world frame.
        normals: ``[N, 3]`` of unit length.
    """

    points: Floats = field(repr=False)
    normals: Floats = field(repr=False)

    def nearest(self, positions: Floats, within: float) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """For positions ``[M, 3]`` the row of the nearest plane, and whether it is within ``within`` metres."""
        from scipy.spatial import cKDTree

        if not len(self.points) or not len(positions):
            return np.zeros(len(positions), np.int64), np.zeros(len(positions), bool)
        distance, row = cKDTree(self.points).query(positions, distance_upper_bound=within)
        found = np.isfinite(distance)
        return np.where(found, row, 0).astype(np.int64), found


def planes_of(scans: Sequence[NDArray[np.float32]], poses: Sequence[Transform]) -> Planes:
    """The planes of scans ``[N, 4]`` taken at poses ``world_from_lidar``."""
    from scipy.spatial import cKDTree

    near = [scan[np.linalg.norm(scan[:, :3], axis=1) < FARTHEST_M] for scan in scans]
    everything = np.concatenate(
        [transform_points(pose, scan[:, :3].astype(np.float64)) for scan, pose in zip(near, poses, strict=True)]
    )
    _, kept = np.unique(np.floor(everything / VOXEL_M).astype(np.int64), axis=0, return_index=True)
    points = everything[np.sort(kept)]
    if len(points) < NEIGHBOURS:
        return Planes(np.empty((0, 3)), np.empty((0, 3)))
    distance, rows = cKDTree(points).query(points, NEIGHBOURS)
    around = points[rows] - points[rows].mean(axis=1, keepdims=True)
    values, axes = np.linalg.eigh(np.einsum("nki,nkj->nij", around, around))
    flat = (values[:, 0] < FLATTEST * values[:, 1]) & (distance[:, -1] < WIDEST_M)
    return Planes(points[flat], axes[flat, :, 0])
