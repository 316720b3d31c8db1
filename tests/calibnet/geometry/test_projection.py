"""Projection and z-buffer against loops over single points."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from calibnet.geometry import PinholeCamera, depth_image, project, transform
from calibnet.geometry.projection import MINIMUM_DEPTH, nearest_per_cell

CAMERA = PinholeCamera(40, 23, np.array([[30.0, 0.0, 18.2], [0.0, 33.0, 10.7], [0.0, 0.0, 1.0]]))
LIDAR_AXES = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
CAMERA_FROM_LIDAR = transform(LIDAR_AXES, [0.1, -0.2, -0.3])


def cloud(count: int, seed: int = 0) -> np.ndarray:
    """Points all around the sensor, also behind and beside the image."""
    points = np.random.default_rng(seed).uniform(-12, 12, (count, 4)).astype(np.float32)
    points[:, 2] *= 0.3
    return points


def pixel_by_hand(point: np.ndarray) -> tuple[float, float, float]:
    """``(u, v, depth)`` of a LiDAR point: x right = -y left, y down = -z up, z = x forward."""
    x, y, z = -float(point[1]) + 0.1, -float(point[2]) - 0.2, float(point[0]) - 0.3
    return (30.0 * x / z + 18.2, 33.0 * y / z + 10.7, z) if z != 0.0 else (math.nan, math.nan, 0.0)


def test_projection_against_a_loop():
    points = cloud(4000)
    expected = {}
    for row, point in enumerate(points):
        u, v, depth = pixel_by_hand(point)
        if depth > MINIMUM_DEPTH and -0.5 < u < 39.5 and -0.5 < v < 22.5:
            expected[row] = (u, v, depth)
    projection = project(points, CAMERA_FROM_LIDAR, CAMERA)
    assert len(expected) > 300
    assert_array_equal(projection.index, sorted(expected))
    assert_allclose(np.column_stack([projection.pixels, projection.depth]), list(expected.values()), atol=2e-4)
    assert projection.pixels.dtype == projection.depth.dtype == np.float32
    assert projection.index.dtype == np.int64


@pytest.mark.parametrize("stride", [1, 4, 8])
def test_nearest_point_of_a_cell_wins(stride):
    points = cloud(6000, seed=stride)
    projection = project(points, CAMERA_FROM_LIDAR, CAMERA)
    nearest: dict[tuple[int, int], int] = {}
    for row, (u, v) in enumerate(projection.pixels.astype(float)):
        # pixel n covers n - 0.5 .. n + 0.5, so cell k of a stride covers k s - 0.5 .. (k + 1) s - 0.5
        cell = (math.floor((v + 0.5) / stride), math.floor((u + 0.5) / stride))
        if cell not in nearest or projection.depth[row] < projection.depth[nearest[cell]]:
            nearest[cell] = row
    winner = nearest_per_cell(projection, CAMERA, stride)
    assert winner.shape == (math.ceil(23 / stride), math.ceil(40 / stride))
    shared = len(projection.index) - len(nearest)
    assert shared > 100, "cells with several points are what a z-buffer is for"
    for cell in np.ndindex(winner.shape):
        assert winner[cell] == nearest.get(cell, -1)


def test_depth_image_holds_the_nearest_depth_or_zero():
    points = cloud(6000)
    expected = np.full((23, 40), np.inf)
    for point in points:
        u, v, depth = pixel_by_hand(point)
        if depth > MINIMUM_DEPTH and -0.5 < u < 39.5 and -0.5 < v < 22.5:
            column, row = round(u), round(v)
            expected[row, column] = min(expected[row, column], depth)
    expected[np.isinf(expected)] = 0.0
    depth = depth_image(points, CAMERA_FROM_LIDAR, CAMERA)
    assert depth.shape == (23, 40)
    assert depth.dtype == np.float32
    assert (expected == 0).any()
    assert_allclose(depth, expected, atol=1e-4)


def test_point_at_a_pixel_centre_falls_into_that_pixel():
    point = np.array([[5.0, 0.0, 0.0, 0.0]], np.float32)
    camera = PinholeCamera(9, 7, np.array([[10.0, 0.0, 8.0], [0.0, 10.0, 6.0], [0.0, 0.0, 1.0]]))
    depth = depth_image(point, transform(LIDAR_AXES, [0, 0, 0]), camera)
    assert depth[6, 8] == 5.0
    assert np.count_nonzero(depth) == 1


def test_order_of_the_points_does_not_matter():
    points = cloud(5000)
    shuffled = np.random.default_rng(1).permutation(points)
    assert_array_equal(depth_image(points, CAMERA_FROM_LIDAR, CAMERA), depth_image(shuffled, CAMERA_FROM_LIDAR, CAMERA))


@pytest.mark.parametrize("points", [np.zeros((0, 4)), [[-5.0, 0, 0, 0]], [[0.7, 0.1, -0.2, 0]], [[5.0, 50, 0, 0]]])
def test_no_visible_point_is_an_empty_image(points):
    points = np.array(points, np.float32).reshape(-1, 4)
    projection = project(points, CAMERA_FROM_LIDAR, CAMERA)
    assert projection.pixels.shape == (0, 2)
    assert not depth_image(points, CAMERA_FROM_LIDAR, CAMERA).any()
    assert (nearest_per_cell(projection, CAMERA) == -1).all()
