"""The fit to image motion, on exact tracks in a corridor whose every surface is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calibnet.geometry import PinholeCamera, invert, transform
from calibnet.geometry.se3 import pose_from_vector, pose_vector, transform_points
from calibnet.geometry.types import Extrinsic, Floats
from calibnet.motion.fit import CENTER, EQUIDISTANT, FOCAL, POSE, RADIAL, Freedom, Pair, Problem, rays, seen

CAMERA = PinholeCamera(1200, 400, np.array([[700.0, 0, 610], [0, 710.0, 190], [0, 0, 1]]))
REFERENCE = transform([[0, -1, 0], [0, 0, -1], [1, 0, 0]], [0.05, -0.1, -0.3])
FLOOR, WALL = -1.7, 5.0
"""Height of the floor, and distance of the walls to either side, in the LiDAR's frame."""
STRAIGHT = np.zeros(4)


def distance(directions: Floats, origin: Floats) -> Floats:
    """How far rays ``[N, 3]`` from an origin ``[3]`` go until they meet the floor, a wall, or the end at 60 m."""
    x, y, z = directions.T
    with np.errstate(divide="ignore"):
        reached = [(60 - origin[0]) / x, (WALL * np.sign(y) - origin[1]) / y, (FLOOR - origin[2]) / z]
    return np.asarray(np.min([np.where(one > 0, one, np.inf) for one in reached], axis=0))


def scan() -> Floats:
    azimuth, elevation = np.meshgrid(np.radians(np.arange(-50, 50, 0.2)), np.radians(np.linspace(-24, 6, 90)))
    directions = np.stack(
        [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], axis=-1
    ).reshape(-1, 3)
    return directions * distance(directions, np.zeros(3))[:, None]


def pair(lens: Floats = STRAIGHT, equidistant: bool = False, turn: float = 0.03, number: int = 0) -> Pair:
    """A car that drives a metre and turns, seen by a camera with this lens; some tracks are of something else."""
    generator = np.random.default_rng(number)
    pixels = generator.uniform([20, 20], [1180, 380], (250, 2))
    motion = invert(pose_from_vector(np.array([1.0, 0.02, 0, 0, 0.002, turn])))
    lidar_from_camera = invert(REFERENCE)
    directions = rays(pixels, CAMERA, lens, equidistant) @ lidar_from_camera[:3, :3].T
    origin = lidar_from_camera[:3, 3]
    world = origin + directions * distance(directions, origin)[:, None]
    there = np.asarray(transform_points(REFERENCE @ motion, world))
    tracked = seen(there, CAMERA, lens, equidistant) + generator.normal(0, 0.1, pixels.shape)
    tracked[::10] += generator.uniform(-20, 20, (25, 2))
    ahead = there[:, 2] > 2
    return Pair(scan(), motion, pixels[ahead], tracked[ahead])


def pairs(lens: Floats = STRAIGHT, equidistant: bool = False) -> list[Pair]:
    return [pair(lens, equidistant, turn, number) for number, turn in enumerate((0.0, 0.05, -0.04, 0.02))]


def moved(by: list[float]) -> Extrinsic:
    return pose_from_vector(np.array(by)) @ REFERENCE


@pytest.mark.parametrize("by", [[0.0] * 6, [0.2, -0.1, 0.5, 0, 0, 0], [0, 0, 0, 0.02, -0.03, 0.02]])
def test_the_extrinsic_is_found_wherever_it_starts(by: list[float]) -> None:
    before = moved(by)
    found = Problem(pairs(), CAMERA, before).fit(POSE)
    left = pose_vector(pose_from_vector(found.unknowns[:6]) @ before @ invert(REFERENCE))
    assert np.abs(left[:3]).max() < 0.01 and np.degrees(np.abs(left[3:]).max()) < 0.05
    stated = np.sqrt(np.diag(found.covariance))
    assert stated[:3].max() < 0.02 and np.degrees(stated[3:].max()) < 0.1


@pytest.mark.parametrize(
    ("lens", "equidistant", "freedom", "row", "value"),
    [
        ([0.05, 0, 0, 0], False, FOCAL, 7, 0.05),
        ([0, 0.03, 0, 0], False, CENTER, 8, 0.03),
        ([0, 0, 0, -0.1], False, RADIAL, 10, -0.1),
        ([0, 0, 0, 0], True, EQUIDISTANT, 10, 0.0),
    ],
)
def test_a_fault_of_the_lens_is_what_explains_the_motion(
    lens: list[float], equidistant: bool, freedom: Freedom, row: int, value: float
) -> None:
    problem = Problem(pairs(np.array(lens), equidistant), CAMERA, REFERENCE)
    alone = problem.fit(POSE)
    costs = {one: float(np.nansum(problem.fit(one, alone).costs)) for one in (FOCAL, CENTER, RADIAL, EQUIDISTANT)}
    best = min(costs, key=lambda one: costs[one])
    assert best == freedom or {best, freedom} == {RADIAL, EQUIDISTANT}  # which look alike
    assert costs[freedom] < 0.9 * np.nansum(alone.costs)
    found = problem.fit(freedom, alone)
    assert found.unknowns[row] == pytest.approx(value, abs=0.012)


def test_pairs_that_disagree_state_a_larger_uncertainty() -> None:
    agreeing = Problem(pairs(), CAMERA, REFERENCE).fit(POSE)
    others = [
        replace(one, seen=one.seen + np.array([2.0 * sign, 0])) for one, sign in zip(pairs(), (1, -1) * 2, strict=True)
    ]
    disagreeing = Problem(others, CAMERA, REFERENCE).fit(POSE)
    assert np.trace(disagreeing.covariance) > 4 * np.trace(agreeing.covariance)


def test_pixels_without_a_surface_are_not_used() -> None:
    one = pair()
    hidden = one.points[one.points[:, 1] < 0]  # nothing to the left
    problem = Problem([replace(one, points=hidden)], CAMERA, REFERENCE)
    expected = problem.predicted()
    assert np.isnan(expected[one.pixels[:, 0] < 500]).all()
    known = np.isfinite(expected).all(axis=1)
    assert known.sum() > 80
    assert np.median(np.linalg.norm(expected[known] - one.seen[known], axis=1)) < 0.3


@pytest.mark.parametrize(("lens", "equidistant"), [([0.02, 0.01, -0.02, 0.15], False), ([0.0, 0, 0, 0], True)])
def test_rays_are_seen_where_they_come_from(lens: list[float], equidistant: bool) -> None:
    pixels = np.random.default_rng(0).uniform([0, 0], [1200, 400], (50, 2))
    there = seen(7 * rays(pixels, CAMERA, np.array(lens), equidistant), CAMERA, np.array(lens), equidistant)
    assert np.abs(there - pixels).max() < 0.01
