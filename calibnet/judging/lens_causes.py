"""Which fault of the lens the matches of a run indicate, and with which probability.

No network runs again: `calibnet.judging.lens_predictors` fits the matches of two looks with other lenses besides the
pose, and a multinomial logistic regression turns these numbers into the probability of each fault, and of none. It is
fitted to frames with such faults by `calib-inspect fit-verdict`.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass

from calibnet.judging.lens_predictors import LensFits, LensPredictors, lens_fits, lens_predictors
from calibnet.trace import CascadeTrace
from calibnet.verdict import Cause

FOCAL, CENTER, BENT = "focal-length", "principal-point", "distortion"
FAULTS = (FOCAL, CENTER, BENT)
"""Faults that can be distinguished. Distortion that was not removed looks like a fisheye lens, so both are named."""
FISHEYE = "lens-model"


@dataclass(frozen=True)
class LensOdds:
    """Multinomial logistic regression: the log odds of each of `FAULTS`, relative to no fault.

    Attributes:
        named_from: a fault is named if it has at least this probability.
        intercepts: log odds of each fault if all predictors are 0.
        weights: change of these log odds per unit of each predictor, by fault and predictor.
    """

    named_from: float
    intercepts: dict[str, float]
    weights: dict[str, dict[str, float]]

    def __call__(self, predictors: LensPredictors) -> dict[str, float]:
        """The probability of each fault; the remainder to 1 is the probability of no fault."""
        numbers = asdict(predictors)
        odds = {
            name: intercept + sum(weight * numbers[of] for of, weight in self.weights[name].items())
            for name, intercept in self.intercepts.items()
        }
        most = max(0.0, *odds.values())
        total = math.exp(-most) + sum(math.exp(value - most) for value in odds.values())
        return {name: math.exp(value - most) / total for name, value in odds.items()}


def lens_causes(trace: CascadeTrace, odds: LensOdds | None) -> tuple[Cause, ...]:
    """The fault of the lens that the matches of a run indicate; empty if none is probable enough.

    Args:
        trace: of the run.
        odds: the fitted regression; without it no fault is named.
    """
    looks = lens_fits(trace) if odds else None
    if odds is None or looks is None:
        return ()
    found, fits = odds(lens_predictors(looks)), looks[0]
    name = max(found, key=lambda one: found[one])
    if found[name] < odds.named_from:
        return ()
    evidence = f"probability {found[name]:.0%}, by a regression fitted to frames with such faults"
    if name == BENT:
        text = (
            "The image looks barrel-distorted: either its distortion was not removed, or it was taken with a fisheye "
            "lens (equidistant)."
        )
        return tuple(Cause(one, text, evidence) for one in (BENT, FISHEYE))
    return (Cause(name, _focal_length(fits) if name == FOCAL else _principal_point(fits), evidence),)


def _focal_length(fits: LensFits) -> str:
    longer = fits.focal.focal - 1  # the finest look has the right sign, and underestimates rather than overestimates
    return (
        f"The image looks as if its focal length were more than {abs(longer):.1%} "
        f"{'longer' if longer > 0 else 'shorter'} than camera_matrix says."
    )


def _principal_point(fits: LensFits) -> str:
    return (
        f"The image looks as if its principal point lay more than {abs(fits.aside):.1%} of the width farther to the "
        f"{'right' if fits.aside > 0 else 'left'} than camera_matrix says, or as if it were shifted."
    )
