"""Which fault of the lens the matches of a run or of a drive indicate, and with which probability.

No network runs again: `calibnet.judging.lens_predictors` fits the matches of looks with other lenses besides the
pose, and a multinomial logistic regression turns these numbers into the probability of each fault, and of none. It is
fitted to frames with such faults by `calib-inspect fit-verdict`.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

from calibnet.judging.lens_predictors import lens_fits, lens_predictors
from calibnet.trace import CascadeTrace, LensReading
from calibnet.verdict import Cause

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

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

    def __call__(self, predictors: DataclassInstance) -> dict[str, float]:
        """The probability of each fault; the remainder to 1 is the probability of no fault.

        Args:
            predictors: those that it was fitted to, of a frame or of a drive.
        """
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
    fine = looks[0].reading._replace(down=0.0)  # in a frame, up and down look like a pitch
    return cause_of(odds, lens_predictors(looks), fine)


def cause_of(odds: LensOdds, predictors: DataclassInstance, found: LensReading) -> tuple[Cause, ...]:
    """The most probable fault, if it is probable enough to be named.

    Args:
        odds: the fitted regression.
        predictors: those that it was fitted to.
        found: fitted values of the lens, which have the right sign, and underestimate rather than overestimate.
    """
    probable = odds(predictors)
    name = max(probable, key=lambda one: probable[one])
    if probable[name] < odds.named_from:
        return ()
    return causes_named(
        name, found, f"probability {probable[name]:.0%}, by a regression fitted to input with such faults"
    )


def causes_named(name: str, found: LensReading, evidence: str) -> tuple[Cause, ...]:
    """The causes of a fault of the lens in words.

    Args:
        name: one of `FAULTS`.
        found: fitted values of the lens.
        evidence: what shows the fault.
    """
    if name == BENT:
        text = (
            "The image looks barrel-distorted: either its distortion was not removed, or it was taken with a fisheye "
            "lens (equidistant)."
        )
        return tuple(Cause(one, text, evidence) for one in (BENT, FISHEYE))
    return (Cause(name, _focal_length(found) if name == FOCAL else _principal_point(found), evidence),)


def _focal_length(found: LensReading) -> str:
    longer = math.exp(found.focal) - 1
    return (
        f"The image looks as if its focal length were more than {abs(longer):.1%} "
        f"{'longer' if longer > 0 else 'shorter'} than camera_matrix says."
    )


def _principal_point(found: LensReading) -> str:
    if abs(found.right) >= abs(found.down):
        offset, where = found.right, "to the right" if found.right > 0 else "to the left"
    else:
        offset, where = found.down, "down" if found.down > 0 else "up"
    return (
        f"The image looks as if its principal point lay more than {abs(offset):.1%} of the width farther {where} than "
        "camera_matrix says, or as if it were shifted."
    )
