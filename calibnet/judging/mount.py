"""The extrinsic of a car over many drives, and between which of them its mount moved.

Every drive contributes an estimate of the extrinsic with a covariance. As long as the mount does not move these
estimates agree, and their mean is more accurate than each of them; where they stop agreeing, the mount moved. The
segments between moves are called stays. They are found by least-squares segmentation with a penalty for each segment,
as `calibnet.drive.changes` finds moves within a drive.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from scipy.stats import chi2

from calibnet.geometry import invert, pose_error
from calibnet.geometry.se3 import pose_from_vector, pose_vector
from calibnet.geometry.types import Extrinsic, Floats, Matrix6, Vector6
from calibnet.verdict import DRIVE_LIMITS

USUAL_EXCESS, USUAL_STEPS = 2.0, 8
"""Prior of how many times larger the squared error of a drive is than it states, and the number of steps from drive to
drive that this prior weighs as much as (docs/decisions.md, A mount over many drives)."""
FALSE_ALARM = 1e-3
"""Probability per mount of reporting a move that did not happen, if errors are as modelled."""
COMMON_DEG, COMMON_M = 0.12, 0.03
"""Standard deviation per axis of the error that all drives of a car have in common, which averaging does not reduce.
Measured on the eight drives of KITTI object/val as taken and through three virtual cameras; it includes what eight
drives do not average out (docs/decisions.md, A mount over many drives)."""
FEWEST = 3
"""Fewest drives that are combined."""


@dataclass(frozen=True, eq=False)
class Finding:
    """The estimate of one drive.

    Attributes:
        camera_from_lidar: 4x4.
        covariance: ``[6, 6]`` of ``(translation m, rotation rad)``, a perturbation in the camera frame.
    """

    camera_from_lidar: Extrinsic = field(repr=False)
    covariance: Matrix6 = field(repr=False)


@dataclass(frozen=True, eq=False)
class Stay:
    """Drives between which the mount did not move.

    Attributes:
        members: positions of these drives among all drives of the mount, ascending.
        camera_from_lidar: their common extrinsic, 4x4.
        covariance: ``[6, 6]`` of it, including the common error of drives.
    """

    members: tuple[int, ...]
    camera_from_lidar: Extrinsic = field(repr=False)
    covariance: Matrix6 = field(repr=False)

    @property
    def is_firm(self) -> bool:
        """Whether there are enough drives to combine."""
        return len(self.members) >= FEWEST


@dataclass(frozen=True, eq=False)
class Mount:
    """A mount over its drives.

    Attributes:
        stays: segments without a move, in order; empty without drives.
        apart: positions of drives that contradict those before and after them, fewer than `FEWEST` in a row.
    """

    stays: tuple[Stay, ...] = ()
    apart: tuple[int, ...] = ()

    def stay_of(self, position: int) -> Stay | None:
        """The stay that a drive belongs to; None for one that is apart."""
        return next((stay for stay in self.stays if position in stay.members), None)


def excess_of(mounts: Iterable[Sequence[Finding]]) -> float:
    """How many times larger the squared errors of drives are than they state, at least 1.

    Measured by the median squared step from each drive to the next one of the same mount, which a few moves hardly
    change, over all mounts of a fleet, because a single mount has few drives.
    """
    squares = [_square(*pair) for drives in mounts for pair in pairwise(drives)]
    measured = float(np.median(squares)) / chi2.median(6) if squares else 0.0
    told = USUAL_STEPS * USUAL_EXCESS + len(squares) * measured
    return max(1.0, told / (USUAL_STEPS + len(squares)))


def mount_over(findings: Sequence[Finding], excess: float = USUAL_EXCESS) -> Mount:
    """Segment the drives of a mount into stays.

    Args:
        findings: estimates of its drives, in the order in which they were recorded.
        excess: factor on their stated covariances, see `excess_of`.
    """
    kept = list(range(len(findings)))
    apart: list[int] = []
    while kept:
        segmentation = _Segmentation([findings[at] for at in kept], excess)
        stays = segmentation.stays()
        odd = min((stop - start, start) for start, stop in stays[1:-1] or [(0, FEWEST)])
        if odd[0] >= FEWEST:
            found = [
                replace(stay, members=tuple(kept[at] for at in stay.members)) for stay in map(segmentation.stay, stays)
            ]
            return Mount(tuple(found), tuple(sorted(apart)))
        apart.append(kept.pop(odd[1]))
    return Mount()


def difference(one: Stay, other: Stay) -> tuple[float, float]:
    """Distance from one stay to another, in degrees and centimetres."""
    error = pose_error(other.camera_from_lidar, one.camera_from_lidar)
    return error.rotation_deg, error.translation_cm


class _Segmentation:
    """Segments the estimates of drives, by running sums of their normal equations relative to one of them."""

    def __init__(self, findings: Sequence[Finding], excess: float) -> None:
        self.origin = findings[len(findings) // 2].camera_from_lidar
        self.vectors = np.array([pose_vector(one.camera_from_lidar @ invert(self.origin)) for one in findings])
        stated = np.array([one.covariance for one in findings])
        self.informations: Floats = np.asarray(np.linalg.inv(stated * excess), np.float64)
        informed = np.einsum("nij,nj->ni", self.informations, self.vectors)
        self._normal = _running(self.informations)
        self._right = _running(informed)
        self._squares = _running(np.einsum("ni,ni->n", informed, self.vectors))

    def stays(self) -> list[tuple[int, int]]:
        """The cheapest segmentation, as ranges ``(start, stop)`` of drives."""
        count = len(self.vectors)
        level = math.log(count / FALSE_ALARM)
        price = 6 + 2 * math.sqrt(6 * level) + 2 * level  # of chi-square with six degrees of freedom, at that level
        cheapest, begun = np.zeros(count + 1), np.zeros(count + 1, int)
        for stop in range(1, count + 1):
            costs = cheapest[:stop] + self._misfits(stop) + price
            begun[stop] = int(np.argmin(costs))
            cheapest[stop] = costs[begun[stop]]
        borders = [count]
        while borders[-1]:
            borders.append(int(begun[borders[-1]]))
        return self._joined(list(pairwise(reversed(borders))))

    def stay(self, place: tuple[int, int]) -> Stay:
        """The combined estimate of the drives in a range."""
        start, stop = place
        mean, covariance = self._agreed(start, stop)
        offsets = self.vectors[start:stop] - mean
        squares = float(np.einsum("ni,nij,nj->", offsets, self.informations[start:stop], offsets))
        scatter = max(1.0, squares / (6 * (stop - start - 1))) if stop - start > 1 else 1.0
        common = np.repeat([COMMON_M, math.radians(COMMON_DEG)], 3) ** 2
        return Stay(
            tuple(range(start, stop)), pose_from_vector(mean) @ self.origin, covariance * scatter + np.diag(common)
        )

    def _joined(self, stays: list[tuple[int, int]]) -> list[tuple[int, int]]:
        """Merge neighbouring stays that differ by less than the limits of a drive."""
        joined = stays[:1]
        for stay in stays[1:]:
            turn, shift = difference(self.stay(joined[-1]), self.stay(stay))
            if turn < DRIVE_LIMITS[0] and shift < DRIVE_LIMITS[1]:
                joined[-1] = (joined[-1][0], stay[1])
            else:
                joined.append(stay)
        return joined

    def _agreed(self, start: int, stop: int) -> tuple[Vector6, Matrix6]:
        covariance = np.linalg.inv(self._normal[stop] - self._normal[start])
        return covariance @ (self._right[stop] - self._right[start]), covariance

    def _misfits(self, stop: int) -> Floats:
        """Squared error ``[stop]`` of the drives from every start to before ``stop``, relative to their mean."""
        normal, right = self._normal[stop] - self._normal[:stop], self._right[stop] - self._right[:stop]
        solved = np.linalg.solve(normal, right[..., None])[..., 0]
        return np.asarray(self._squares[stop] - self._squares[:stop] - np.einsum("ni,ni->n", right, solved))


def _running(values: Floats) -> Floats:
    """Cumulative sums ``[N + 1, ...]``, beginning with 0."""
    return np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(values, axis=0)])


def _square(one: Finding, other: Finding) -> float:
    """Squared difference of two estimates, normalised by their covariances."""
    offset = pose_vector(other.camera_from_lidar @ invert(one.camera_from_lidar))
    return float(offset @ np.linalg.solve(one.covariance + other.covariance, offset))
