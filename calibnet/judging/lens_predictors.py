"""What two looks of a run say of the lens: the finest one, and a coarse one, whose window holds a whole bend.

The finest look sees little of a wrong focal length or principal point, because the looks before have explained most of
it by a wrong pose, but what it sees has the right direction. A coarse look sees all of it, less sharply.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from calibnet.judging.lens import LENSES, PINHOLE, Fit, fit
from calibnet.trace import CascadeTrace, StageTrace

COARSE = 3
"""From the last stage backwards: the look whose window still holds a whole bend."""
LEAST_GAIN = -1.0
"""An equidistant lens that makes matches of a pinhole cost more than twice as much counts as this."""


@dataclass(frozen=True)
class LensPredictors:
    """Numbers of the finest look and of a coarse one, whose matches are fitted with another lens besides the pose.

    Attributes:
        fine_focal_gain, coarse_focal_gain: share of the matches' cost that another focal length saves.
        fine_focal, coarse_focal: logarithm of the factor of that focal length, true by believed.
        fine_focal_size, coarse_focal_size: its absolute value.
        fine_center_gain, coarse_center_gain: share of the cost that another principal point saves.
        fine_center_size, coarse_center_size: how far it lies aside, in widths of the picture.
        fine_radial_gain, coarse_radial_gain: share of the cost that radial distortion saves.
        fine_radial, coarse_radial: its coefficient k1.
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
    """A look's matches fitted with the pose alone, and with each of `calibnet.judging.lens.LENSES` besides.

    Attributes:
        alone: with the pose alone.
        focal, center, radial, equidistant: with that besides.
        width: of the picture, pixels.
    """

    alone: Fit
    focal: Fit
    center: Fit
    radial: Fit
    equidistant: Fit
    width: int

    @classmethod
    def of(cls, look: StageTrace) -> LensFits | None:
        """Fit a look's matches; None where it has none."""
        matches, prior, origin = look.matches, look.range.information, look.looked_from
        if matches is None or not len(matches.points):
            return None
        alone, focal, center, radial, equidistant = (
            fit(matches, origin, look.camera, origin, prior, lens) for lens in (PINHOLE, *LENSES)
        )
        return cls(alone, focal, center, radial, equidistant, look.camera.width)

    @property
    def aside(self) -> float:
        """How far to the right the principal point lies, in widths of the picture."""
        return float(self.center.center[0]) / self.width

    def gain(self, other: Fit) -> float:
        """The share of the cost that a lens saves; negative where it adds some."""
        return 1 - other.cost / self.alone.cost if self.alone.cost > 0 else 0.0

    @property
    def numbers(self) -> tuple[float, ...]:
        """Those of `LensPredictors` that are of one look, in its order."""
        focal = math.log(self.focal.focal)
        return (
            self.gain(self.focal),
            focal,
            abs(focal),
            self.gain(self.center),
            abs(self.aside),
            self.gain(self.radial),
            self.radial.radial,
            max(self.gain(self.equidistant), LEAST_GAIN),
        )


def lens_fits(trace: CascadeTrace) -> tuple[LensFits, LensFits] | None:
    """The finest look and the coarse one of a run, fitted; None where it has too few stages, or no matches."""
    if len(trace.stages) < COARSE:
        return None
    fine, coarse = LensFits.of(trace.stages[-1]), LensFits.of(trace.stages[-COARSE])
    return (fine, coarse) if fine and coarse else None


def lens_predictors(looks: tuple[LensFits, LensFits]) -> LensPredictors:
    """The predictors of a run, of its looks as `lens_fits` has them."""
    return LensPredictors(*(number for look in looks for number in look.numbers))
