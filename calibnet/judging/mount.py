"""Where a mount was over many drives: what one drive leaves open, the drives of a car tell together.

Every drive says with a covariance where it finds the extrinsic. While the mount stays where it is they say the same,
so a car is known better than any of its drives; where they stop saying the same, the mount moved. Stays are found by
the segmentation of least squared error with a price for each, as `calibnet.drive.changes` finds moves within a drive.
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
"""How many times larger the squared error of a drive is taken to be than it states, and how many steps from drive to
drive that counts for against what they say themselves (docs/decisions.md, A mount over many drives)."""
FALSE_ALARM = 1e-3
"""Probability, a mount, of a move where there is none, if errors were as they are modelled."""
COMMON_DEG, COMMON_M = 0.12, 0.03
"""Standard deviation, an axis, of what all drives of a car get wrong alike: it stays, however many there are. Measured
on the eight drives of KITTI object/val as taken and through three virtual cameras; what eight drives do not average
out is in it (docs/decisions.md, A mount over many drives)."""
FEWEST = 3
"""Drives that have to agree before they say more than each by itself."""


@dataclass(frozen=True, eq=False)
class Finding:
    """Where a drive finds the extrinsic.

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
        members: their positions among all drives of the mount, ascending.
        camera_from_lidar: where it was, 4x4.
        covariance: ``[6, 6]`` of it, with what drives get wrong alike.
    """

    members: tuple[int, ...]
    camera_from_lidar: Extrinsic = field(repr=False)
    covariance: Matrix6 = field(repr=False)

    @property
    def is_firm(self) -> bool:
        """Whether so many drives agree that they say more than each by itself."""
        return len(self.members) >= FEWEST


@dataclass(frozen=True, eq=False)
class Mount:
    """A mount over its drives: it stayed, moved, and stayed again.

    Attributes:
        stays: in their order; none for no drive.
        apart: positions of drives that say what neither those before nor those after them say, fewer than `FEWEST` in
            a row.
    """

    stays: tuple[Stay, ...] = ()
    apart: tuple[int, ...] = ()

    def stay_of(self, position: int) -> Stay | None:
        """The stay that a drive belongs to; None for one that stands apart."""
        return next((stay for stay in self.stays if position in stay.members), None)


def excess_of(mounts: Iterable[Sequence[Finding]]) -> float:
    """How many times larger squared errors of drives are than they state, at least 1.

    Measured by the steps from each drive to the next one of the same mount, in the median, which a few moves do not
    change; over all mounts of a fleet, for one alone has few.
    """
    squares = [_square(*pair) for drives in mounts for pair in pairwise(drives)]
    measured = float(np.median(squares)) / chi2.median(6) if squares else 0.0
    told = USUAL_STEPS * USUAL_EXCESS + len(squares) * measured
    return max(1.0, told / (USUAL_STEPS + len(squares)))


def mount_over(findings: Sequence[Finding], excess: float = USUAL_EXCESS) -> Mount:
    """Where a mount was.

    Args:
        findings: of its drives, in the order in which they were driven.
        excess: of their squared errors, `excess_of`.
    """
    kept = list(range(len(findings)))
    apart: list[int] = []
    while kept:
        said = _Said([findings[at] for at in kept], excess)
        stays = said.stays()
        odd = min((stop - start, start) for start, stop in stays[1:-1] or [(0, FEWEST)])
        if odd[0] >= FEWEST:
            found = [replace(stay, members=tuple(kept[at] for at in stay.members)) for stay in map(said.stay, stays)]
            return Mount(tuple(found), tuple(sorted(apart)))
        apart.append(kept.pop(odd[1]))
    return Mount()


def difference(one: Stay, other: Stay) -> tuple[float, float]:
    """From one stay to another: degrees and centimetres."""
    error = pose_error(other.camera_from_lidar, one.camera_from_lidar)
    return error.rotation_deg, error.translation_cm


class _Said:
    """What drives say, relative to one of them, with running sums over their normal equations."""

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
        """From where to before where the mount stayed: the cheapest way to cut the drives into stays."""
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
        """What the drives of a stay agree on."""
        start, stop = place
        mean, covariance = self._agreed(start, stop)
        offsets = self.vectors[start:stop] - mean
        squares = float(np.einsum("ni,nij,nj->", offsets, self.informations[start:stop], offsets))
        scatter = max(1.0, squares / (6 * (stop - start - 1))) if stop - start > 1 else 1.0
        alike = np.repeat([COMMON_M, math.radians(COMMON_DEG)], 3) ** 2
        return Stay(
            tuple(range(start, stop)), pose_from_vector(mean) @ self.origin, covariance * scatter + np.diag(alike)
        )

    def _joined(self, stays: list[tuple[int, int]]) -> list[tuple[int, int]]:
        """Without moves that are too small to be one of the mount."""
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
        """Squared errors ``[stop]`` of the drives from every start to before ``stop``, against what they agree on."""
        normal, right = self._normal[stop] - self._normal[:stop], self._right[stop] - self._right[:stop]
        solved = np.linalg.solve(normal, right[..., None])[..., 0]
        return np.asarray(self._squares[stop] - self._squares[:stop] - np.einsum("ni,ni->n", right, solved))


def _running(values: Floats) -> Floats:
    """Sums ``[N + 1, ...]`` of the first values."""
    return np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(values, axis=0)])


def _square(one: Finding, other: Finding) -> float:
    """Squared difference of two findings, in their standard deviations."""
    offset = pose_vector(other.camera_from_lidar @ invert(one.camera_from_lidar))
    return float(offset @ np.linalg.solve(one.covariance + other.covariance, offset))
