"""Faults of the lens that the frames of a drive show together, or the motion in its images.

All frames of a drive have one lens. What the matches of a single frame say of it varies as much as with a fault; the
median over frames of different places varies much less, so that a drive shows faults that no frame shows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calibnet.judging.lens_causes import BENT, CENTER, FOCAL, LensOdds, cause_of, causes_named
from calibnet.judging.lens_predictors import LEAST_GAIN, LensFits
from calibnet.trace import DriveLook, LensReading, MotionEstimate, StageTrace
from calibnet.verdict import Cause

LEAST_MOTION_GAIN = 0.05
"""Least share of the cost of a drive's motion that a fault of the lens has to save to be named."""


@dataclass(frozen=True)
class DriveLensPredictors:
    """Predictors of a fault of the lens: of the costs of all frames together, and medians over the frames.

    Attributes:
        focal_gain: share of the matches' cost that another focal length saves.
        focal, focal_size: logarithm of that focal length relative to that of the calibration, and its absolute value.
        center_gain: share of the cost that another principal point saves.
        right_size, down_size: absolute offset of that principal point, in widths of the image.
        radial_gain: share of the cost that radial distortion saves.
        radial: the fitted coefficient k1.
        equidistant_gain: share of the cost that an equidistant lens saves.
    """

    focal_gain: float
    focal: float
    focal_size: float
    center_gain: float
    right_size: float
    down_size: float
    radial_gain: float
    radial: float
    equidistant_gain: float


def lens_reading(look: StageTrace) -> LensReading | None:
    """What the matches of a look say of the lens; None if it has none."""
    fits = LensFits.of(look)
    return None if fits is None else fits.reading


def median_reading(looks: Sequence[DriveLook]) -> LensReading | None:
    """The frames' summed costs, and the medians of what was fitted; None if no frame has matches."""
    readings = np.array([look.lens for look in looks if look.lens is not None])
    if not len(readings):
        return None
    costs = LensReading._fields.index("focal")
    return LensReading(*readings[:, :costs].sum(axis=0).tolist(), *np.median(readings[:, costs:], axis=0).tolist())


def drive_lens_predictors(found: LensReading) -> DriveLensPredictors:
    """The predictors from what `median_reading` returns."""

    def gain(cost: float) -> float:
        return 1 - cost / found.cost if found.cost > 0 else 0.0

    return DriveLensPredictors(
        focal_gain=gain(found.focal_cost),
        focal=found.focal,
        focal_size=abs(found.focal),
        center_gain=gain(found.center_cost),
        right_size=abs(found.right),
        down_size=abs(found.down),
        radial_gain=gain(found.radial_cost),
        radial=found.radial,
        equidistant_gain=max(gain(found.equidistant_cost), LEAST_GAIN),
    )


def drive_lens_causes(looks: Sequence[DriveLook], odds: LensOdds | None, fewest: int) -> tuple[Cause, ...]:
    """The fault of the lens that the frames of a drive show together, of each camera; empty if none is probable enough.

    Args:
        looks: the last look at every frame.
        odds: the fitted regression; without it no fault is named.
        fewest: number of moments of a camera that are needed.
    """
    causes = list[Cause]()
    for camera in dict.fromkeys(look.camera for look in looks):
        own = [look for look in looks if look.camera == camera]
        found = median_reading(own)
        if odds is None or found is None or len({look.position for look in own}) < fewest:
            continue
        for cause in cause_of(odds, drive_lens_predictors(found), found):
            causes.append(replace(cause, text=f"Camera {camera}: {cause.text}") if camera else cause)
    return tuple(causes)


def motion_lens_causes(motion: MotionEstimate | None) -> tuple[Cause, ...]:
    """The fault of the lens that explains the motion in the images better than none; empty if none does.

    Needs no regression: without a fault, another lens hardly explains it better (docs/decisions.md, "Motion").
    """
    if motion is None or not motion.certain:
        return ()
    found, gains = motion.lens, gains_of(motion.lens)
    name = max(gains, key=lambda one: gains[one])
    if gains[name] < LEAST_MOTION_GAIN:
        return ()
    return causes_named(name, found, f"it explains the motion in the images better, by {gains[name]:.0%} of its cost")


def gains_of(found: LensReading) -> dict[str, float]:
    """The share of the cost that each fault of the lens would save."""
    costs = {FOCAL: found.focal_cost, CENTER: found.center_cost, BENT: min(found.radial_cost, found.equidistant_cost)}
    return {name: 1 - cost / found.cost if found.cost > 0 else 0.0 for name, cost in costs.items()}
