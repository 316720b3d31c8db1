"""Colours and sizes of an overlay's points: by depth, intensity, edge, or error against the reference."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from calibnet.geometry import transform_points
from calibnet.geometry.projection import Projection
from inspector import colors
from inspector.record.contents import Coloring
from inspector.record.observation import Observation

POINT_SIZE: Final = 1.4
"""Radius in screen points, so that zooming separates the points instead of enlarging them."""
EDGE_SIZE: Final = 1.7
REST_SIZE: Final = 0.7
EDGE_JUMP: Final = 0.1
"""Share of a point's range by which a neighbour at an edge is farther away, and at least half a metre."""
EDGE_CELL_DEG: Final = (0.25, 0.5)
"""Azimuth and elevation of a cell of the range image in which neighbours are searched, in degrees."""
EDGE_REACH: Final = 2
"""Number of cells to either side in which neighbours are searched."""

Paint = tuple[NDArray[np.uint8], NDArray[np.float32]]
"""``[M, 3]`` RGB and ``[M]`` radii in screen points."""
Painter = Callable[[Projection, NDArray[np.int64]], Paint]
"""Paints the points in the given rows of a projection."""


def make_painter(observation: Observation, coloring: Coloring) -> Painter:
    """The painter of one frame; except for depth and error, a point has the same colour under every extrinsic."""
    points = observation.frame.points
    if coloring is Coloring.INTENSITY:
        return _by_scan(colors.map_colors(points[:, 3], *colors.robust_limits(points[:, 3])))
    if coloring is Coloring.EDGE:
        edges = depth_edges(points)
        return _by_scan(np.where(edges[:, None], colors.EDGE, colors.REST).astype(np.uint8), edges)
    if coloring is Coloring.ERROR:
        return _error_painter(observation)
    return paint_depth


def paint_depth(projection: Projection, rows: NDArray[np.int64]) -> Paint:
    """Depth along the optical axis, near red to far blue."""
    return colors.depth_colors(projection.depth[rows]), _sizes(len(rows))


def depth_edges(points: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Whether each point of a scan ``[N, >=3]`` is at a depth edge, next to which the scanner sees farther: ``[N]``.

    It depends only on the scan, so that all overlays highlight the same points.
    """
    x, y, z = points[:, :3].T
    distance = np.sqrt(x * x + y * y + z * z)
    azimuth, elevation = np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))
    width, height = round(360 / EDGE_CELL_DEG[0]), round(180 / EDGE_CELL_DEG[1])
    column = ((np.degrees(azimuth) + 180) / EDGE_CELL_DEG[0]).astype(np.intp) % width
    row = np.clip((np.degrees(elevation) + 90) / EDGE_CELL_DEG[1], 0, height - 1).astype(np.intp)
    farthest = np.zeros((height, width), dtype=np.float32)
    np.maximum.at(farthest, (row, column), distance)
    beside = cv2.dilate(farthest, np.ones((1, 2 * EDGE_REACH + 1), np.uint8))
    edges: NDArray[np.bool_] = beside[row, column] - distance > np.maximum(0.5, EDGE_JUMP * distance)
    return edges


def _by_scan(scan_colors: NDArray[np.uint8], emphasised: NDArray[np.bool_] | None = None) -> Painter:
    def paint(projection: Projection, rows: NDArray[np.int64]) -> Paint:
        scan = projection.index[rows]
        if emphasised is None:
            return scan_colors[scan], _sizes(len(rows))
        sizes = np.where(emphasised[scan], EDGE_SIZE, REST_SIZE).astype(np.float32)
        return scan_colors[scan], sizes

    return paint


def _error_painter(observation: Observation) -> Painter:
    """Pixels between where an extrinsic puts a point and where the reference puts it."""
    frame, reference = observation.frame, observation.reference
    assert reference is not None, "the command line refuses --color error without a reference"
    seen = frame.as_taken.camera.see(transform_points(reference, frame.points[:, :3].astype(np.float64)))
    pixels = np.where(seen.valid[:, None], seen.pixels, np.inf)

    def paint(projection: Projection, rows: NDArray[np.int64]) -> Paint:
        off = np.linalg.norm(projection.pixels[rows] - pixels[projection.index[rows]], axis=1)
        return colors.error_colors(off), _sizes(len(rows))

    return paint


def _sizes(count: int) -> NDArray[np.float32]:
    return np.full(count, POINT_SIZE, dtype=np.float32)
