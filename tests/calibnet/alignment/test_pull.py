from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from calibnet.alignment.pull import Map, Sampled
from calibnet.geometry import PinholeCamera
from calibnet.geometry.se3 import pose_from_vector
from calibnet.geometry.types import Transform

CAMERA = PinholeCamera(200, 100, np.array([[120.0, 7.0, 100.0], [0, 130.0, 50.0], [0, 0, 1]]))
"""With skew."""
ROWS, COLUMNS = np.mgrid[0:100, 0:200].astype(np.float32)
SLOPED = Map((0.5 * COLUMNS - 0.25 * ROWS).astype(np.float32), CAMERA)


def some_points(count: int = 50) -> NDArray[np.float32]:
    generator = np.random.default_rng(0)
    return generator.uniform([-2, -1, 5], [2, 1, 20], (count, 3)).astype(np.float32)


def read(points: NDArray[np.float32], pose: Transform) -> Sampled:
    return SLOPED.under(points, pose)


def test_a_map_is_read_where_its_camera_sees_the_points() -> None:
    points = some_points()
    pixels = points @ CAMERA.matrix.T
    u, v = (pixels[:, :2] / pixels[:, 2:]).T
    np.testing.assert_allclose(read(points, np.eye(4)).values, 0.5 * u - 0.25 * v, atol=0.02)  # in 32nds of a pixel


@pytest.mark.parametrize("vector", [np.zeros(6), np.array([0.5, -0.3, 0.8, 0.1, -0.15, 0.2])])
def test_gradients_are_forces_and_torques(vector: NDArray[np.float64]) -> None:
    points, pose = some_points(), pose_from_vector(vector)
    weights = np.random.default_rng(1).uniform(size=len(points))
    found = read(points, pose).gradient(weights, pose[:3, 3])
    for axis in range(6):
        sums = []
        for sign in (1, -1):
            motion = np.zeros(6)
            motion[axis] = sign * (0.2 if axis < 3 else 0.02)
            further = pose_from_vector(motion)
            moved = pose.copy()
            moved[:3, :3] = further[:3, :3] @ pose[:3, :3]
            moved[:3, 3] += motion[:3]
            sums.append(weights @ read(points, moved).values)
        step = 0.4 if axis < 3 else 0.04
        assert (sums[0] - sums[1]) / step == pytest.approx(found[axis], rel=0.01, abs=0.3)


def test_points_behind_the_camera_and_beyond_the_border_pull_nowhere() -> None:
    far_left, behind = np.array([[-50, 0, 5]], np.float32), np.array([[0.001, 0, -3]], np.float32)
    assert read(far_left, np.eye(4)).forces[0, 0] == 0
    forces = read(behind, np.eye(4)).forces
    assert np.isfinite(forces).all() and forces[0, 2] == 0
