"""Computes the attributes of the points of a scan: reflectance, normal and segment."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from calibnet.alignment.evidence import ranks
from calibnet.geometry.types import Floats

if TYPE_CHECKING:
    from open3d.geometry import PointCloud

MOST_POINTS = 9000
"""Largest number of points, evenly from the scan; the score of every pose reads all of them."""
NEIGHBOURS = 20
"""Number of points that a normal is fitted to."""
PLANES, PLANE_M, PLANE_SHARE = 3, 0.15, 0.08
"""Largest number of planes to extract (ground, walls), largest distance of their points, and the smallest share of the
scan on a plane."""
CLUSTER_M, PIECE_M, CLUSTER_FEWEST = 0.8, 1.6, 8
"""Largest distance of neighbours in a cluster, and in a piece of a plane; fewest points of a cluster."""


@dataclass(frozen=True, eq=False)
class Attributes:
    """Points with their attributes.

    Attributes:
        points: ``[N, 3]`` float32, metres, in the LiDAR frame.
        reflectance: ``[N]``, rank 0..1 among all points, as every scanner has its own scale.
        normals: ``[N, 3]``, of unit length, towards the scanner.
        segments: ``[N]``, number of the segment from 1; 0 for points in none.
    """

    points: NDArray[np.float32] = field(repr=False)
    reflectance: Floats = field(repr=False)
    normals: Floats = field(repr=False)
    segments: NDArray[np.int64] = field(repr=False)

    def only(self, rows: NDArray[np.int64]) -> Attributes:
        """The points in some rows."""
        return Attributes(self.points[rows], self.reflectance[rows], self.normals[rows], self.segments[rows])


def attributes(scan: NDArray[np.float32], seed: int = 0) -> Attributes:
    """The attributes of the points of a scan ``[N, 4]``.

    As in the paper, planes are extracted first and the remaining points are clustered. Clusters are wide here, as fewer
    points are used.
    """
    import open3d as o3d

    chosen = scan[np.linspace(0, len(scan) - 1, min(len(scan), MOST_POINTS)).astype(np.int64)]
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(chosen[:, :3].astype(np.float64)))
    cloud.estimate_normals(o3d.geometry.KDTreeSearchParamKNN(NEIGHBOURS))
    cloud.orient_normals_towards_camera_location(np.zeros(3))
    o3d.utility.random.seed(seed)
    return Attributes(chosen[:, :3], ranks(chosen[:, 3]), np.asarray(cloud.normals), _segments(cloud))


def _segments(cloud: PointCloud) -> NDArray[np.int64]:
    """Segments: the connected pieces of every plane, then clusters of the remaining points."""
    total = len(cloud.points)
    segments, left = np.zeros(total, np.int64), np.arange(total)

    def cut(rows: NDArray[np.int64], reach: float) -> None:
        pieces = np.asarray(cloud.select_by_index(rows.tolist()).cluster_dbscan(reach, CLUSTER_FEWEST), np.int64)
        segments[rows] = np.where(pieces >= 0, segments.max() + 1 + pieces, 0)

    for _ in range(PLANES):
        if len(left) < max(3, PLANE_SHARE * total):
            break
        _, found = cloud.select_by_index(left.tolist()).segment_plane(PLANE_M, 3, 400)
        if len(found) < PLANE_SHARE * total:
            break
        cut(left[found], PIECE_M)
        left = np.delete(left, found)
    if len(left):
        cut(left, CLUSTER_M)
    return segments
