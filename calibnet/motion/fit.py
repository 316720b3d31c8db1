"""Fits the extrinsic, and one property of the lens if asked, to the motion of pixels from image to image.

The unknowns are a correction of the extrinsic, the logarithm of how much longer the way is than registration says, and
four numbers of the lens: the logarithm of the focal length relative to that of the calibration, the offset of the
principal point to the right and down in widths of the image, and the first radial coefficient.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from calibnet.geometry import PinholeCamera, invert, transform_points
from calibnet.geometry.projection import MINIMUM_DEPTH
from calibnet.geometry.se3 import pose_from_vector
from calibnet.geometry.types import Extrinsic, Floats, Transform
from calibnet.motion.surface import NEIGHBOURS, nearest_points, surface

MOST_ROUNDS = 10
"""Largest number of times that the scan's points around each pixel are looked for anew, as the fit moves them."""
SETTLED = 0.05
"""A fit is done when a round moves no unknown by more than this share of its step in `STEPS`."""
MOST_EVALUATIONS = 12
"""Largest number of steps in a round."""
OUTLIER = 2.0
"""Residual, in standard deviations of its pair, beyond which a track loses weight (Cauchy)."""
LEAST_SCALE_PX = 0.15
"""Lower limit of that standard deviation: tracking is no more accurate."""
SIGMA = np.array([0.5] * 3 + [0.1] * 3 + [0.005] + [0.1, 0.1, 0.1, 0.3])
"""Prior standard deviations of the unknowns, all wide but that of the way, which registration determines better."""
STEPS = np.array([0.02] * 3 + [0.001] * 3 + [0.002] + [0.004, 0.002, 0.002, 0.01])
"""Steps of the unknowns over which derivatives are measured: a tenth of a pixel and more."""

WAY, LENS = 6, slice(7, 11)
"""Rows of the unknowns."""


@dataclass(frozen=True, eq=False)
class Pair:
    """Two successive frames.

    Attributes:
        points: ``[M, 3]``, points of the first scan in the LiDAR's frame, those that the image may show.
        motion: from the LiDAR's frame at the first scan to that at the second, 4x4.
        pixels: ``[N, 2]`` of the first image.
        seen: ``[N, 2]``, where they were tracked to in the second image.
    """

    points: Floats = field(repr=False)
    motion: Transform
    pixels: Floats = field(repr=False)
    seen: Floats = field(repr=False)


class Freedom(NamedTuple):
    """What is fitted of the lens besides the extrinsic: the rows of the unknowns, and whether it is a fisheye lens."""

    rows: tuple[int, ...] = ()
    equidistant: bool = False

    @property
    def free(self) -> list[int]:
        """Rows of the unknowns that are fitted."""
        return [*range(7), *self.rows]


POSE = Freedom()
LENSES = FOCAL, CENTER, RADIAL, EQUIDISTANT = (
    Freedom((7,)),
    Freedom((8, 9)),
    Freedom((10,)),
    Freedom((), equidistant=True),
)


@dataclass(frozen=True, eq=False)
class Fit:
    """The tracks of some pairs, fitted.

    Attributes:
        unknowns: ``[11]``, correction ``(translation m, rotation rad)``, way and lens.
        covariance: ``[6, 6]`` of the correction, from how much the pairs differ.
        costs: ``[N]`` cost of each track; NaN where the scan has no surface.
        scale: ``[pairs]`` standard deviation of the residuals of each pair, in pixels.
    """

    unknowns: Floats
    covariance: Floats = field(repr=False)
    costs: Floats = field(repr=False)
    scale: Floats = field(repr=False)


class Problem:
    """The tracks of some pairs of one camera, near an extrinsic."""

    def __init__(self, pairs: Sequence[Pair], camera: PinholeCamera, before: Extrinsic) -> None:
        """Fit corrections of ``before``."""
        self.pairs, self.camera, self.before = pairs, camera, before
        self.pixels = np.concatenate([pair.pixels for pair in pairs])
        self.seen = np.concatenate([pair.seen for pair in pairs])
        self.pair = np.repeat(np.arange(len(pairs)), [len(pair.pixels) for pair in pairs])
        self.motion = np.array([pair.motion for pair in pairs])[self.pair]

    def fit(self, freedom: Freedom, start: Fit | None = None, correction: Floats | None = None) -> Fit:
        """Fit the extrinsic and what is free of the lens, from the result of another fit if given.

        The other fit's scales and tracks are kept, so that costs of both can be compared. With ``correction [6]`` the
        fit begins there instead.
        """
        unknowns = np.zeros(11) if start is None else start.unknowns.copy()
        if correction is not None:
            unknowns[:6] = correction
        allowed, scale = np.ones(len(self.pixels), bool), np.ones(len(self.pairs))
        if start is not None:
            allowed, scale = np.isfinite(start.costs), start.scale
        for _ in range(MOST_ROUNDS):
            near = self._near(unknowns, freedom.equidistant)
            residuals = self._residuals(unknowns, near, freedom.equidistant)
            used = np.asarray(np.isfinite(residuals).all(axis=1) & allowed)
            if start is None:
                scale = self._scale(residuals)
            before, unknowns = unknowns, self._settled(unknowns, freedom, near, used, scale)
            if (np.abs(unknowns - before) < SETTLED * STEPS).all():
                break
        near = self._near(unknowns, freedom.equidistant)
        residuals = self._residuals(unknowns, near, freedom.equidistant) / scale[self.pair, None]
        costs = np.log1p((residuals / OUTLIER) ** 2).sum(axis=1)
        if start is not None:  # what a fit cannot explain costs as much as before
            costs = np.where(np.isfinite(costs) | ~allowed, costs, start.costs)
            costs[~allowed] = np.nan
        return Fit(unknowns, self._covariance(unknowns, near, freedom, scale), costs, scale)

    def _settled(
        self, unknowns: Floats, freedom: Freedom, near: Floats, used: NDArray[np.bool_], scale: Floats
    ) -> Floats:
        """The best unknowns near some others, with the same points around each pixel and the same tracks."""
        from scipy.optimize import least_squares

        free, found = freedom.free, unknowns.copy()

        def weighted(values: Floats) -> Floats:
            found[free] = values
            residuals = self._residuals(found, near, freedom.equidistant, used) / scale[self.pair[used], None]
            return np.concatenate([residuals.ravel(), values / SIGMA[free]])

        steps = {"x_scale": SIGMA[free], "max_nfev": MOST_EVALUATIONS}
        found[free] = least_squares(weighted, unknowns[free], loss="cauchy", f_scale=OUTLIER, **steps).x
        return found

    def predicted(self, unknowns: Floats | None = None, equidistant: bool = False) -> Floats:
        """Where the pixels should be in the second images, ``[N, 2]``; NaN where the scan has no surface."""
        unknowns = np.zeros(11) if unknowns is None else unknowns
        near = self._near(unknowns, equidistant)
        return np.asarray(self.seen - self._residuals(unknowns, near, equidistant))

    def _near(self, unknowns: Floats, equidistant: bool) -> Floats:
        """Points ``[N, NEIGHBOURS, 3]`` of the scans around each pixel, in the LiDAR's frame."""
        extrinsic = pose_from_vector(unknowns[:6]) @ self.before
        near = []
        for pair in self.pairs:
            moved = np.asarray(transform_points(extrinsic, pair.points), np.float64)
            at = seen(moved, self.camera, unknowns[LENS], equidistant)
            at[moved[:, 2] < MINIMUM_DEPTH] = -1e6  # beside no pixel
            near.append(pair.points[nearest_points(pair.pixels, at)])
        return np.concatenate(near)

    def _residuals(
        self, unknowns: Floats, near: Floats, equidistant: bool, used: NDArray[np.bool_] | None = None
    ) -> Floats:
        """Tracked minus predicted pixels ``[N, 2]`` of the tracks that are used, by default all.

        NaN where the scan has no surface, if all are asked for.
        """
        rows = np.arange(len(self.pixels)) if used is None else np.flatnonzero(used)
        extrinsic = pose_from_vector(unknowns[:6]) @ self.before
        lens, pixels = unknowns[LENS], self.pixels[rows]
        moved = np.asarray(transform_points(extrinsic, near[rows].reshape(-1, 3)), np.float64)
        around = seen(moved, self.camera, lens, equidistant).reshape(len(rows), NEIGHBOURS, 2)
        found = surface(pixels, around, moved[:, 2].reshape(len(rows), NEIGHBOURS), self.camera.width)
        inverse = np.where(found.known, found.inverse_depth, 1.0) if used is None else found.inverse_depth
        motion = self.motion[rows]
        motion[:, :3, 3] *= np.exp(unknowns[WAY])
        later: Floats = extrinsic @ motion @ invert(extrinsic)
        there = np.einsum("nij,nj->ni", later[:, :3, :3], rays(pixels, self.camera, lens, equidistant))
        there = there + inverse[:, None] * later[:, :3, 3]  # of a point at unit inverse depth, so that far ones are too
        residuals = np.asarray(self.seen[rows] - seen(there, self.camera, lens, equidistant))
        if used is None:
            residuals[~found.known | (there[:, 2] < MINIMUM_DEPTH * inverse)] = np.nan
        return residuals

    def _scale(self, residuals: Floats) -> Floats:
        """The standard deviation of each pair's residuals, from the median of their lengths."""
        length = np.linalg.norm(residuals, axis=1)
        medians = [np.nanmedian(np.append(length[self.pair == number], 0.0)) for number in range(len(self.pairs))]
        return np.asarray(np.maximum(np.array(medians) / np.sqrt(2 * np.log(2)), LEAST_SCALE_PX))

    def _covariance(self, unknowns: Floats, near: Floats, freedom: Freedom, scale: Floats) -> Floats:
        """Covariance ``[6, 6]`` of the correction; each pair is one measurement, whose tracks err together."""
        free = freedom.free

        def at(values: Floats) -> Floats:
            return self._residuals(values, near, freedom.equidistant) / scale[self.pair, None]

        here = at(unknowns)
        steps = np.diag(STEPS)[free]
        derivatives = np.stack([(at(unknowns + step) - at(unknowns - step)) / (2 * step.max()) for step in steps], -1)
        used = np.isfinite(here).all(axis=1) & np.isfinite(derivatives).all(axis=(1, 2))
        here, derivatives, pair = here[used], derivatives[used], self.pair[used]
        weights = 1 / (1 + (here / OUTLIER) ** 2)
        normal = np.einsum("nai,na,naj->ij", derivatives, weights, derivatives) + np.diag(SIGMA[free] ** -2)
        gradients = np.zeros((len(self.pairs), len(free)))
        np.add.at(gradients, pair, np.einsum("nai,na->ni", derivatives, weights * here))
        inverse = np.linalg.inv(normal)
        few = len(self.pairs) / max(1, len(self.pairs) - 1)
        covariance = (
            few * inverse @ (gradients.T @ gradients) @ inverse + inverse @ np.diag(SIGMA[free] ** -2) @ inverse
        )
        return np.asarray(covariance[:6, :6], np.float64)


def rays(pixels: Floats, camera: PinholeCamera, lens: Floats, equidistant: bool) -> Floats:
    """Directions ``[N, 3]`` of pixels ``[N, 2]``, with ``z`` 1, through a lens of four numbers (see above)."""
    focal, center = _matrix(camera, lens)
    bent = (pixels - center) / focal
    straight = bent
    if equidistant:
        angle = np.minimum(np.linalg.norm(bent, axis=1, keepdims=True), 1.5)
        straight = bent * np.tan(angle) / np.maximum(angle, 1e-9)
    elif lens[3]:
        for _ in range(6):
            straight = bent / (1 + lens[3] * (straight**2).sum(axis=1, keepdims=True))
    return np.concatenate([straight, np.ones((len(pixels), 1))], axis=1)


def seen(points: Floats, camera: PinholeCamera, lens: Floats, equidistant: bool) -> Floats:
    """Pixels ``[N, 2]`` of points ``[N, 3]`` in the camera's frame, the inverse of `rays`."""
    focal, center = _matrix(camera, lens)
    straight = points[:, :2] / np.maximum(points[:, 2:], 1e-3)
    factor = np.asarray(1.0)
    if equidistant:
        radius = np.maximum(np.linalg.norm(straight, axis=1, keepdims=True), 1e-9)
        factor = np.arctan(radius) / radius
    elif lens[3]:
        factor = 1 + lens[3] * (straight**2).sum(axis=1, keepdims=True)
    return np.asarray(straight * factor * focal + center, np.float64)


def _matrix(camera: PinholeCamera, lens: Floats) -> tuple[Floats, Floats]:
    """Focal lengths ``[2]`` and principal point ``[2]`` in pixels."""
    return np.exp(lens[0]) * np.array(camera.focal), camera.matrix[:2, 2] + camera.width * lens[1:3]
