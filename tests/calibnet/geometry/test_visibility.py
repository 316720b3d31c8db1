"""A cloud of several scans shows what one of them would have seen, and a scan is left alone."""

from __future__ import annotations

import numpy as np
import pytest

from calibnet.datasets.clouds.plausibility import several
from calibnet.datasets.synthetic import SyntheticSequence
from calibnet.geometry.visibility import as_one_scan, is_accumulated
from tests.support.pillars import CAR, PILLAR, WALL, scan

SCANS = [scan(ahead, left) for ahead, left in ((0.0, 0.0), (-2.0, -4.0), (-1.0, -2.0), (1.0, 2.0), (2.0, 4.0))]
"""The road from five places; the car drives to the left meanwhile."""


def at(points: np.ndarray, x: float) -> np.ndarray:
    """What stands on the road there."""
    return points[(np.abs(points[:, 0] - x) < 0.05) & (points[:, 2] > -1.3)]


@pytest.mark.parametrize("count", [1, 2, 3, 4, 5])
def test_a_cloud_of_several_scans_is_told_from_a_scan(count):
    """Two scans a metre apart are not yet many points a ray."""
    assert is_accumulated(np.concatenate(SCANS[:count])) == (count >= 3)


@pytest.mark.parametrize("step", [0.05, 0.1, 0.4])
def test_a_scan_is_none_whatever_its_density(step):
    assert not is_accumulated(scan(0.0, 0.0, step))


def test_two_echoes_of_a_ray_are_none():
    """A dense scanner, and one that reports the strongest and the last echo where they differ."""
    one = scan(0.0, 0.0)
    last = one[np.random.default_rng(0).random(len(one)) < 0.05]
    last[:, :3] *= 1.3
    assert not is_accumulated(np.concatenate([one, last]))
    assert not is_accumulated(np.concatenate([one, one]))


def test_no_scan_of_the_synthetic_world_is_taken_for_several():
    for seed in range(3):
        assert not is_accumulated(SyntheticSequence(seed=seed, length=1)[0].points)


def test_nothing_is_no_cloud_of_several_scans():
    assert not is_accumulated(np.zeros((0, 4), np.float32))


def test_what_came_and_went_is_left_out():
    """Each of the five scans has the car in another place, and the others saw through it."""
    cars = [len(at(one, CAR)) for one in SCANS]
    assert min(cars) > 300
    assert len(at(as_one_scan(np.concatenate(SCANS)), CAR)) < 0.02 * sum(cars)


def test_what_stands_still_and_is_in_sight_stays():
    points = as_one_scan(np.concatenate(SCANS))
    for x in (PILLAR, WALL):
        kept, one = at(points, x), at(SCANS[0], x)
        found, expected = (np.percentile(some[:, 1:3], (2, 98), axis=0) for some in (kept, one))
        np.testing.assert_allclose(found, expected, rtol=0.05, atol=0.1)
        assert 0.8 * len(one) < len(kept) < 3 * len(one)


def test_what_is_hidden_is_left_out():
    """From elsewhere the scans see the wall where the pillar hides it from the origin."""
    cloud = np.concatenate([scan(ahead, 30.0) for ahead in (0.0, -2.0, -1.0, 1.0, 2.0)])

    def behind_pillar(points: np.ndarray) -> int:
        wall = at(points, WALL)
        left = wall[:, 1] / wall[:, 0] * PILLAR
        return int(((left > -2.9) & (left < -2.5)).sum())

    assert behind_pillar(scan(0.0, 30.0)) == 0
    assert behind_pillar(cloud) > 100
    assert behind_pillar(as_one_scan(cloud)) == 0


def test_the_result_is_one_scan():
    cloud = np.concatenate(SCANS)
    once = as_one_scan(cloud)
    assert not is_accumulated(once)
    rows = {row.tobytes() for row in cloud}
    assert all(row.tobytes() in rows for row in once[::50]), "points are left out, never changed"


def test_a_cloud_of_several_scans_is_remarked_on():
    assert several(SCANS[0]) is None
    remark = several(np.concatenate(SCANS))
    assert remark is not None and remark.name == "accumulated" and not remark.certain
