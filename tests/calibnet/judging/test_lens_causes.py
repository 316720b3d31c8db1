"""What two looks say of the lens, and the fault that is named for it: with its direction, or none."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from calibnet.geometry import miscalibration
from calibnet.geometry.types import Floats
from calibnet.judging.lens_causes import lens_causes
from calibnet.judging.lens_predictors import LensPredictors, lens_fits, lens_predictors
from calibnet.trace import CascadeTrace
from tests.support.drive import REFERENCE
from tests.support.matches import LENS_ODDS, matches, run

GUESS = miscalibration([0.3, -0.2, 0.4], [0.05, 0.02, -0.04]) @ REFERENCE
BARREL = ["distortion", "lens-model"]


def barrel(places: Floats) -> Floats:
    return places * (1 - 0.15 * (places**2).sum(axis=1, keepdims=True))


def seen(bend: Callable[[Floats], Floats]) -> CascadeTrace:
    """A run whose looks find the scan as a lens shows it."""
    return run(GUESS, REFERENCE, matches(np.eye(4), bend, noise=0.5))


def said(trace: CascadeTrace) -> LensPredictors:
    looks = lens_fits(trace)
    assert looks is not None
    return lens_predictors(looks)


def test_the_predictors_are_how_other_lenses_fit_the_finest_look_and_a_coarse_one() -> None:
    shorter, bent = seen(lambda places: 0.97 * places), seen(barrel)
    mixed = said(replace(shorter, stages=(bent.stages[0], *shorter.stages[1:])))
    assert mixed.fine_focal == pytest.approx(math.log(0.97), abs=0.005) and mixed.fine_focal_size == -mixed.fine_focal
    assert mixed.fine_focal_gain > 0.3 > mixed.fine_radial_gain
    assert mixed.coarse_radial == pytest.approx(-0.15, abs=0.02) and mixed.coarse_radial_gain > mixed.coarse_focal_gain
    aside = said(seen(lambda places: places + np.array([-0.05, 0.0])))
    assert aside.fine_center_size == pytest.approx(0.05 * 580 / 1024, rel=0.1)
    assert aside.fine_equidistant_gain == -1.0  # at most twice the cost is told
    straight = said(seen(lambda places: places))
    assert max(straight.fine_focal_gain, straight.fine_center_gain, straight.coarse_radial_gain) < 0.02


def test_probabilities_are_those_of_the_fitted_odds() -> None:
    found = replace(said(seen(lambda places: places)), fine_focal_gain=0.2, fine_center_gain=0.1, fine_radial_gain=0.0)
    odds = np.exp([0.0, 2.0, 0.0, -2.0])  # none, then each fault
    assert list(LENS_ODDS(found).values()) == pytest.approx(odds[1:] / odds.sum())
    far = replace(found, fine_focal_gain=1e4)
    assert LENS_ODDS(far)["focal-length"] == 1.0 and math.isfinite(sum(LENS_ODDS(far).values()))


@pytest.mark.parametrize(
    ("bend", "names", "text"),
    [
        (lambda places: places, [], ""),
        (lambda places: 0.97 * places, ["focal-length"], "% shorter"),
        (lambda places: 1.03 * places, ["focal-length"], "% longer"),
        (lambda places: places + np.array([0.05, 0]), ["principal-point"], "of the width farther to the right"),
        (lambda places: places - np.array([0.05, 0]), ["principal-point"], "of the width farther to the left"),
        (barrel, BARREL, "looks barrel-distorted"),
    ],
)
def test_the_likeliest_fault_is_named_with_its_direction(
    bend: Callable[[Floats], Floats], names: list[str], text: str
) -> None:
    found = lens_causes(seen(bend), LENS_ODDS)
    assert [cause.name for cause in found] == names
    assert all(text in cause.text and "%, by a regression fitted to" in cause.evidence for cause in found)


def test_nothing_is_named_that_is_not_likely_enough_or_cannot_be_told() -> None:
    trace = seen(lambda places: 0.97 * places)
    assert lens_causes(trace, replace(LENS_ODDS, named_from=1.0)) == ()
    assert lens_causes(trace, None) == ()
    assert lens_causes(run(GUESS, REFERENCE), LENS_ODDS) == ()  # no matches
    assert lens_causes(replace(trace, stages=trace.stages[1:]), LENS_ODDS) == ()  # no coarse look
