"""Predictors of a fault of the lens, from two looks of a run: the finest one and a coarse one.

The finest look sees little of a wrong focal length or principal point, because earlier looks have compensated most of
it by a wrong pose; but what remains has the right sign. The window of a coarse look is large enough to show all of it,
less precisely.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from calibnet.judging.lens import LENSES, PINHOLE, Fit, fit
from calibnet.trace import CascadeTrace, LensReading, StageTrace

COARSE = 3
"""The coarse look is that of the third stage from the end, whose window covers a whole distortion."""
LEAST_GAIN = -1.0
"""Lower limit of the gain of an equidistant lens, which is very negative for the matches of a pinhole camera."""


@dataclass(frozen=True)
class LensPredictors:
    """Results of fitting the matches of the fine and of the coarse look with another lens in addition to the pose.

    Attributes:
        fine_focal_gain, coarse_focal_gain: share of the matches' cost that another focal length saves.
        fine_focal, coarse_focal: logarithm of the fitted focal length relative to that of the calibration.
        fine_focal_size, coarse_focal_size: absolute value of this logarithm.
        fine_center_gain, coarse_center_gain: share of the cost that another principal point saves.
        fine_center_size, coarse_center_size: horizontal offset of that principal point, in widths of the image.
        fine_radial_gain, coarse_radial_gain: share of the cost that radial distortion saves.
        fine_radial, coarse_radial: the fitted coefficient k1.
        fine_equidistant_gain, coarse_equidistant_gain: share of the cost that an equidistant lens saves.
    """

    fine_focal_gain: float
    fine_focal: float
    fine_focal_size: float
    fine_center_gain: float
    fine_center_size: float
    fine_radial_gain: float
    fine_radial: float
    fine_equidistant_gain: float
    coarse_focal_gain: float
    coarse_focal: float
    coarse_focal_size: float
    coarse_center_gain: float
    coarse_center_size: float
    coarse_radial_gain: float
    coarse_radial: float
    coarse_equidistant_gain: float


@dataclass(frozen=True, eq=False)
class LensFits:
    """The matches of a look fitted with the pose alone, and with the pose and each of `calibnet.judging.lens.LENSES`.

    Attributes:
        alone: fit of the pose alone.
        focal, center, radial, equidistant: fits of the pose and that property of the lens.
        width: width of the image in pixels.
    """

    alone: Fit
    focal: Fit
    center: Fit
    radial: Fit
    equidistant: Fit
    width: int

    @classmethod
    def of(cls, look: StageTrace) -> LensFits | None:
        """Fit the matches of a look; None if it has none."""
        matches, prior, origin = look.matches, look.range.information, look.looked_from
        if matches is None or not len(matches.points):
            return None
        alone, focal, center, radial, equidistant = (
            fit(matches, origin, look.camera, prior, lens) for lens in (PINHOLE, *LENSES)
        )
        return cls(alone, focal, center, radial, equidistant, look.camera.width)

    @property
    def reading(self) -> LensReading:
        """Costs and fitted values in the form that drives keep."""
        right, down = self.center.center / self.width
        return LensReading(
            cost=self.alone.cost,
            focal_cost=self.focal.cost,
            center_cost=self.center.cost,
            radial_cost=self.radial.cost,
            equidistant_cost=self.equidistant.cost,
            focal=math.log(self.focal.focal),
            right=float(right),
            down=float(down),
            radial=self.radial.radial,
        )

    def gain(self, other: Fit) -> float:
        """The share of the cost that a lens saves; negative if it increases the cost."""
        return 1 - other.cost / self.alone.cost if self.alone.cost > 0 else 0.0

    @property
    def numbers(self) -> tuple[float, ...]:
        """This look's part of `LensPredictors`, in its order."""
        reading = self.reading
        return (
            self.gain(self.focal),
            reading.focal,
            abs(reading.focal),
            self.gain(self.center),
            abs(reading.right),
            self.gain(self.radial),
            reading.radial,
            max(self.gain(self.equidistant), LEAST_GAIN),
        )


def lens_fits(trace: CascadeTrace) -> tuple[LensFits, LensFits] | None:
    """Fits of a run's finest and coarse look; None if the run has too few stages or a look has no matches."""
    if len(trace.stages) < COARSE:
        return None
    fine, coarse = LensFits.of(trace.stages[-1]), LensFits.of(trace.stages[-COARSE])
    return (fine, coarse) if fine and coarse else None


def lens_predictors(looks: tuple[LensFits, LensFits]) -> LensPredictors:
    """The predictors of a run from the two fits that `lens_fits` returns."""
    return LensPredictors(*(number for look in looks for number in look.numbers))
