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
STILL_M = 0.03
"""Largest median change of range between scans at a standstill, in metres."""


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
