"""Chooses the moments of a drive to calibrate: spread over it, and preferably at a standstill."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from calibnet.geometry.types import Floats

MOMENTS = 40
"""Default number of frames taken from a bag; more of one drive add little."""
SHORTEST_S = 1.0
"""Shortest default period from one frame to the next, in seconds."""
TRIED = 3
"""Number of moments of each period among which the stillest is searched."""
CELL_DEG = 2.0
STILL_M = 0.04
"""Largest motion between scans at a standstill, in metres; of surfaces seen by few points up to 3.5 cm are noise."""
VOXEL_M, FARTHEST_M = 0.25, 40.0
"""Size of the cells to which scans are thinned out before surfaces are compared, and the range of points used."""
MOST_SURFACES, NEIGHBOURS = 3000, 8
"""Number of places at which scans are compared, and of points that make a surface."""
FLAT, LINE = 0.03, 0.1
"""A surface's largest depth relative to its width, and smallest width relative to its length, both squared."""
FACING, FEWEST_FACING = 0.7, 10
"""Cosine from which a surface faces an axis, and the number of such surfaces that show motion along it."""


def motion(one: NDArray[np.float32], other: NDArray[np.float32]) -> float:
    """How far the scanner moved from one scan ``[N, 4]`` to another, in metres: a measure of standing, not of distance.

    Scans that repeat their pattern have the same ranges at a standstill. Those of a scanner that does not, such as
    Livox's, are compared by surfaces.
    """
    found = change(one, other)
    return found if found <= STILL_M else min(found, shift(one, other))


def shift(one: NDArray[np.float32], other: NDArray[np.float32]) -> float:
    """Largest of the three median distances from one scan's points to the other's surfaces that face x, y, and z.

    Along a street, most surfaces are parallel to the motion and show nothing of it, so each axis counts by itself.

    Returns:
        metres; infinity if an axis has too few surfaces.
    """
    from scipy.spatial import cKDTree

    points, others = _thinned(one), _thinned(other)
    if min(len(points), len(others)) < NEIGHBOURS:
        return np.inf
    points = points[:: max(1, len(points) // MOST_SURFACES)]
    distances, nearest = cKDTree(others).query(points, NEIGHBOURS)
    near = distances[:, -1] < 4 * VOXEL_M
    around = others[nearest[near]]
    middles = around.mean(axis=1)
    deviations = around - middles[:, None]
    variances, axes = np.linalg.eigh(np.einsum("nki,nkj->nij", deviations, deviations))
    is_flat = (variances[:, 0] < FLAT * variances[:, 1]) & (variances[:, 1] > LINE * variances[:, 2])
    normals = axes[is_flat][:, :, 0]
    apart = np.abs(((middles - points[near])[is_flat] * normals).sum(axis=1))
    facing = [apart[np.abs(normals[:, axis]) > FACING] for axis in range(3)]
    return max(float(np.median(some)) if len(some) >= FEWEST_FACING else np.inf for some in facing)


def _thinned(points: NDArray[np.float32]) -> Floats:
    """The mean of the points in each cell, ``[M, 3]``."""
    places = points[:, :3].astype(np.float64)
    places = places[np.linalg.norm(places, axis=1) < FARTHEST_M]  # false for NaN
    _, cell, count = np.unique(np.floor(places / VOXEL_M), axis=0, return_inverse=True, return_counts=True)
    return np.stack([np.bincount(cell.reshape(-1), places[:, axis], len(count)) / count for axis in range(3)], axis=1)


def change(one: NDArray[np.float32], other: NDArray[np.float32]) -> float:
    """Median change of range over all directions from one scan ``[N, 4]`` to another, in metres."""
    ranges = [_ranges(points) for points in (one, other)]
    both = np.isfinite(ranges[0]) & np.isfinite(ranges[1])
    return float(np.median(np.abs(ranges[0] - ranges[1])[both])) if both.any() else np.inf


def periods(seconds: Floats, every: float | None) -> list[NDArray[np.int64]]:
    """Positions of times by period, in order; about `MOMENTS` periods by default.

    Args:
        seconds: ``[N]``, rising.
        every: length of a period in seconds.
    """
    length = every if every is not None else max(SHORTEST_S, float(np.ptp(seconds)) / MOMENTS)
    number = np.floor((seconds - seconds[0]) / max(length, 1e-3)).astype(np.int64)
    return [np.flatnonzero(number == one) for one in np.unique(number)]


def stillest(candidates: Sequence[int], moved: Callable[[int], float]) -> tuple[int, float]:
    """The candidate with the smallest change, of `TRIED` spread over all, and that change."""
    some = np.unique(np.linspace(0, len(candidates) - 1, min(TRIED, len(candidates))).astype(int))
    found = {int(candidates[place]): moved(int(candidates[place])) for place in some}
    best = min(found, key=lambda position: (found[position], position))
    return best, found[best]


def standing(position: int, together: int, scans: int, moved: Callable[[int, int], float]) -> range:
    """The scans around a position to put together: as many as asked for, without those before or after a standstill.

    Args:
        position: number of a scan at a standstill.
        together: number of scans asked for.
        scans: number of scans there are.
        moved: the motion between two scans.
    """
    first = max(0, min(position - together // 2, scans - together))
    last = max(position, min(first + together, scans) - 1)
    while first < position and moved(first, position) > STILL_M:
        first += 1
    while last > position and moved(last, position) > STILL_M:
        last -= 1
    return range(first, last + 1)


def _ranges(points: NDArray[np.float32]) -> Floats:
    """The median range in each cell of directions; NaN in empty cells."""
    x, y, z = points[:, :3].astype(np.float64).T
    distance = np.sqrt(x * x + y * y + z * z)
    real = np.isfinite(distance)
    x, y, z, distance = x[real], y[real], z[real], distance[real]
    column = ((np.degrees(np.arctan2(y, x)) + 180) / CELL_DEG).astype(int)
    row = ((np.degrees(np.arctan2(z, np.hypot(x, y))) + 90) / CELL_DEG).astype(int)
    width = int(360 / CELL_DEG) + 1
    cell = row * width + column
    order = np.lexsort((distance, cell))
    cells, starts, counts = np.unique(cell[order], return_index=True, return_counts=True)
    ranges = np.full(width * (int(180 / CELL_DEG) + 1), np.nan)
    ranges[cells] = distance[order][starts + counts // 2]
    return ranges
