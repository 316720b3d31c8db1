"""The lens that matches ask for, named with its direction; and none where the pose explains them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from calibnet.geometry import miscalibration
from calibnet.geometry.types import Floats
from calibnet.judging.lens_causes import lens_causes
from tests.support.drive import REFERENCE
from tests.support.matches import matches, run

GUESS = miscalibration([0.3, -0.2, 0.4], [0.05, 0.02, -0.04]) @ REFERENCE
BARREL = ["distortion", "lens-model"]


def barrel(places: Floats) -> Floats:
    return places * (1 - 0.15 * (places**2).sum(axis=1, keepdims=True))


def equidistant(places: Floats) -> Floats:
    radius = np.hypot(*places.T)[:, None]
    return places * np.arctan(radius) / radius


@pytest.mark.parametrize(
    ("bend", "names", "said"),
    [
        (lambda places: places, [], ""),
        (lambda places: 0.98 * places, ["focal-length"], "more than 2% shorter"),
        (lambda places: 1.03 * places, ["focal-length"], "more than 3% longer"),
        (lambda places: 1.004 * places, [], ""),  # as much as without a fault
        (lambda places: places + np.array([0.05, 0]), ["principal-point"], "of the width farther to the right"),
        (lambda places: places - np.array([0.05, 0]), ["principal-point"], "of the width farther to the left"),
        (barrel, BARREL, "looks barrel-shaped"),
        (equidistant, BARREL, "looks barrel-shaped"),
    ],
)
def test_a_lens_is_named_with_its_direction(bend: Callable[[Floats], Floats], names: list[str], said: str) -> None:
    found = lens_causes(run(GUESS, REFERENCE, matches(np.eye(4), bend, noise=0.5)))
    assert [cause.name for cause in found] == names
    assert all(said in cause.text for cause in found)


@pytest.mark.parametrize(("fine", "names"), [(1.0, ["focal-length", *BARREL]), (0.98, ["focal-length"])])
def test_a_bend_that_a_shorter_focal_length_explains_better_is_told_by_the_fine_look(
    fine: float, names: list[str]
) -> None:
    """A coarse look takes a focal length that is far too long for a bend as well."""
    bent = run(GUESS, REFERENCE, matches(np.eye(4), lambda places: 0.85 * places, noise=0.5)).stages
    straight = run(GUESS, REFERENCE, matches(np.eye(4), lambda places: fine * places, noise=0.5))
    found = lens_causes(replace(straight, stages=(bent[0], *straight.stages[1:])))
    assert [cause.name for cause in found] == names
    assert "shorter" in found[0].text


def test_what_the_look_again_finds_counts_and_without_matches_nothing_is_named() -> None:
    shorter = matches(np.eye(4), lambda places: 0.97 * places, noise=0.5)
    straight = run(GUESS, REFERENCE, matches(np.eye(4), noise=0.5))
    again = replace(straight, again=run(GUESS, REFERENCE, shorter).stages[-1])
    assert lens_causes(straight) == () and [cause.name for cause in lens_causes(again)] == ["focal-length"]
    assert lens_causes(run(GUESS, REFERENCE)) == ()
