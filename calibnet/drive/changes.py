"""Change-point detection on the results of a drive's frames: where the mount moved, by how much, and how surely.

The results of frames (`calibnet.trace.DriveLook`) scatter, and the errors of neighbouring frames are correlated, since
they see the same objects. Noise is therefore measured from frame to frame and over blocks, whose means scatter more
than those of independent errors. Changes are found by penalised least-squares segmentation (PELT, from the library
ruptures), or by a slope if that explains more; each is then tested for significance.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import ruptures
from scipy.stats import chi2

from calibnet.geometry.types import Floats, Matrix6, Vector6
from calibnet.trace import DriveLook
from calibnet.watch import WINDOW, Change, Watch

SHORTEST = 8
"""Smallest number of frames between two changes, before the first and after the last; fewer are outliers."""
BLOCK = 10
"""Number of frames of the blocks over which correlated errors are measured."""
USUAL_EXCESS, USUAL_BLOCKS = 4.0, 4
"""Usual ratio of the variance of a long mean to that of independent errors, and the number of blocks for which it
counts against the drive's own ratio, which is uncertain for a short drive."""
FALSE_ALARM = 1e-3
"""Probability per drive of a false change, if errors are as modelled."""
OUTLIER = 3.0
"""Distance from its neighbours in standard deviations to which an outlier is reduced."""


def watch(looks: Sequence[DriveLook]) -> Watch:
    """Find the changes of a drive.

    Args:
        looks: results of its frames in order, all relative to one extrinsic; at least twice `SHORTEST`.

    Raises:
        ValueError: there are too few.
    """
    if len(looks) < 2 * SHORTEST:
        raise ValueError(f"{len(looks)} frames are too few to detect a change; {2 * SHORTEST} are needed.")
    frames = np.array([look.frame for look in looks])
    offsets = without_outliers(np.array([look.offset for look in looks]))
    covariance = scatter(offsets)
    whitener = np.linalg.inv(np.linalg.cholesky(covariance))
    white = (offsets - offsets.mean(axis=0)) @ whitener.T
    excess = long_run_excess(white)
    changes = _changes(frames, offsets, white / math.sqrt(excess), covariance * excess)
    means, counts = windowed(
        offsets, [int(np.searchsorted(frames, change.frame)) for change in changes if change.until is None]
    )
    deviation = np.sqrt(np.diag(covariance) * excess)
    return Watch(
        frames, offsets, means, deviation / np.sqrt(counts)[:, None], changes, deviation * math.sqrt(2 / WINDOW)
    )


def windowed(offsets: Floats, borders: Sequence[int] = ()) -> tuple[Floats, Floats]:
    """Means ``[N, 6]`` of the frames around each, and their numbers ``[N]``; no window crosses a change.

    Args:
        offsets: ``[N, 6]``.
        borders: positions of the first frames after changes, ascending.
    """
    means, counts, half = np.empty_like(offsets), np.empty(len(offsets)), WINDOW // 2
    for start, stop in pairwise([0, *borders, len(offsets)]):
        for at in range(start, stop):
            around = offsets[max(start, at - half) : min(stop, at + half)]
            means[at], counts[at] = around.mean(axis=0), len(around)
    return means, counts


def without_outliers(offsets: Floats) -> Floats:
    """The results of frames ``[N, 6]``, with outliers moved closer to their neighbours."""
    half = WINDOW // 2
    around = np.array([np.median(offsets[max(0, at - half) : at + half + 1], axis=0) for at in range(len(offsets))])
    away = offsets - around
    most = OUTLIER * np.maximum(1.4826 * np.median(np.abs(away), axis=0), 1e-9)
    return np.asarray(around + np.clip(away, -most, most))


def scatter(offsets: Floats) -> Matrix6:
    """Covariance ``[6, 6]`` of a single frame, from differences between neighbours, which steps hardly affect."""
    steps = np.diff(offsets, axis=0)
    most = OUTLIER * np.maximum(1.4826 * np.median(np.abs(steps), axis=0), 1e-9)
    kept = np.clip(steps, -most, most)
    ridge = np.diag(np.repeat([1e-4, np.radians(1e-3)], 3) ** 2)
    return np.asarray(kept.T @ kept / (2 * len(kept)) + ridge)


def long_run_excess(white: Floats) -> float:
    """Ratio of the variance of a mean of many frames to that of independent ones, at least 1.

    Args:
        white: ``[N, 6]`` results of frames, in standard deviations from frame to frame.
    """
    blocks = len(white) // BLOCK
    usual = USUAL_EXCESS * USUAL_BLOCKS
    if blocks < 2:
        return USUAL_EXCESS
    means = white[: blocks * BLOCK].reshape(blocks, BLOCK, -1).mean(axis=1)
    steps = np.diff(means, axis=0) ** 2
    # the median of chi-square with one degree of freedom is 0.455; a few steps of the mount do not move the median
    measured = BLOCK * np.median(steps, axis=0) / 2 / 0.455
    return max(1.0, float((usual + len(steps) * measured.mean()) / (USUAL_BLOCKS + len(steps))))


def _changes(frames: Floats, offsets: Floats, white: Floats, covariance: Matrix6) -> tuple[Change, ...]:
    """Steps, or a drift, that are significant and large enough.

    Args:
        frames: ``[N]`` numbers of the frames.
        offsets: ``[N, 6]``.
        white: ``[N, 6]`` the same results, scaled so that the variance of long means is 1.
        covariance: ``[6, 6]`` of a frame, from long means.
    """
    count = len(offsets)
    level = math.log(count / FALSE_ALARM)
    price = 6 + 2 * math.sqrt(6 * level) + 2 * level  # of chi-square with six degrees of freedom, at that level
    ends = ruptures.KernelCPD(kernel="linear", min_size=SHORTEST).fit(white).predict(pen=price)
    borders = [0, *ends]
    stepped = sum(_squares(white[a:b]) for a, b in pairwise(borders)) + price * (len(ends) - 1)
    time = np.linspace(-0.5, 0.5, count)
    slope = time @ white / (time @ time)
    sloped = _squares(white - time[:, None] * slope) + price
    if sloped < min(stepped, _squares(white)):
        found = time @ offsets / (time @ time)
        certain = _confidence(found, covariance / (time @ time), 1)
        drift = Change(int(frames[0]), found, certain, int(frames[-1]))
        return (drift,) if drift.matters and certain > 1 - FALSE_ALARM else ()
    changes = []
    for before, at, after in zip(borders, borders[1:], borders[2:], strict=False):
        moved = offsets[at:after].mean(axis=0) - offsets[before:at].mean(axis=0)
        certain = _confidence(moved, covariance * (1 / (at - before) + 1 / (after - at)), count)
        changes.append(Change(int(frames[at]), moved, certain))
    return tuple(change for change in changes if change.matters and change.confidence > 1 - FALSE_ALARM)


def _squares(white: Floats) -> float:
    return float(((white - white.mean(axis=0)) ** 2).sum())


def _confidence(moved: Vector6, covariance: Matrix6, places: int) -> float:
    """Probability that a move is not due to chance at any of ``places``."""
    square = float(moved @ np.linalg.solve(covariance, moved))
    return max(0.0, 1.0 - places * float(chi2.sf(square, 6)))
