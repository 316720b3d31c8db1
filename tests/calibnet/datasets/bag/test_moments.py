from __future__ import annotations

import numpy as np
import pytest

from calibnet.datasets.bag.moments import STILL_M, change, motion, shift, standing


def scan(seed: int, moved_m: float = 0.0, points: int = 6000) -> np.ndarray:
    """Random points of a street with houses at its end, as a scanner sees them that never repeats its pattern."""
    random = np.random.default_rng(seed)
    along, across, up = random.uniform(-15, 15, points), random.uniform(-6, 6, points), random.uniform(-2, 4, points)
    side = random.choice([-1.0, 1.0], points)
    surfaces = [
        np.stack([along, across, np.full(points, -2.0)], axis=1),
        np.stack([along, 6 * side, up], axis=1),
        np.stack([15 * side, across, up], axis=1),
    ]
    places = np.concatenate(surfaces) + random.normal(0, 0.01, (3 * points, 3)) - [moved_m, 0, 0]
    return np.column_stack([places, np.zeros(len(places))]).astype(np.float32)


def test_a_scanner_that_never_repeats_its_pattern_stands_still() -> None:
    assert motion(scan(0), scan(1)) < STILL_M


@pytest.mark.parametrize("moved_m", [0.1, 0.5, 3.0])
def test_motion_along_a_street_is_seen_although_most_surfaces_are_parallel_to_it(moved_m: float) -> None:
    assert motion(scan(0), scan(1, moved_m)) > STILL_M


def test_without_a_surface_that_faces_an_axis_nothing_is_known() -> None:
    ground = scan(0)
    ground = ground[ground[:, 2] < -1.9]
    assert shift(ground, ground) == np.inf
    assert shift(ground[:3], ground[:3]) == np.inf
    assert motion(ground, ground) == 0.0, "the same ranges in all directions"


def test_points_without_a_place_do_not_move_a_scan() -> None:
    points = scan(0)
    nowhere = np.vstack([points, np.full((3, 4), np.nan, np.float32), np.full((3, 4), np.inf, np.float32)])
    assert change(points, nowhere) == 0.0
    assert shift(points, nowhere) < STILL_M


@pytest.mark.parametrize(
    ("position", "together", "expected"),
    [(5, 1, [5]), (5, 4, [3, 4, 5, 6]), (2, 6, [2, 3, 4, 5]), (6, 4, [4, 5, 6, 7]), (4, 100, [2, 3, 4, 5, 6, 7])],
)
def test_only_scans_of_one_standstill_are_put_together(position: int, together: int, expected: list[int]) -> None:
    """The car stands during scans 2 to 7 of 10."""
    places = [0.0, 1.0, 2.0, 2.0, 2.0, 2.0, 2.0, 2.0, 3.0, 4.0]
    found = standing(position, together, len(places), lambda one, other: abs(places[one] - places[other]))
    assert list(found) == expected
