"""Camera models against OpenCV, where it has them, and against their papers' formulas, where it has not."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from calibnet.geometry import CameraModel, PinholeCamera, project, project_through
from calibnet.geometry.camera_model import COEFFICIENTS

MATRIX = np.array([[400.0, 0.0, 310.0], [0.0, 410.0, 250.0], [0.0, 0.0, 1.0]])
POINTS = np.random.default_rng(3).uniform([-3, -2, 4], [3, 2, 9], (200, 3))
FISHEYE = [0.02, -0.008, 0.003, -0.0006]
OPENCV = [-0.28, 0.09, 0.001, -0.002, -0.02, 0.03, 0.01, -0.004, 0.002, -0.001, 0.003, 0.0005, 0.02, -0.01]


def camera(model: str, coefficients: list[float]) -> CameraModel:
    return CameraModel(640, 480, MATRIX, model, np.array(coefficients))


@pytest.mark.parametrize("count", [4, 5, 8, 12, 14])
def test_opencv_coefficients_are_those_of_opencv(count):
    model = "plumb_bob" if count <= 5 else "rational_polynomial"
    seen = camera(model, OPENCV[:count]).see(POINTS)
    expected = cv2.projectPoints(POINTS, np.zeros(3), np.zeros(3), MATRIX, np.array(OPENCV[:count]))[0][:, 0]
    assert_allclose(seen.pixels, expected, atol=1e-9)
    assert seen.valid.all()


def test_equidistant_is_the_fisheye_of_opencv():
    seen = camera("equidistant", FISHEYE).see(POINTS)
    points = POINTS[:, None]
    expected = cv2.fisheye.projectPoints(points, np.zeros(3), np.zeros(3), MATRIX, np.array(FISHEYE))[0][:, 0]
    assert_allclose(seen.pixels, expected, atol=1e-9)


def test_equidistant_sees_to_the_side_and_behind():
    """90 degrees off the axis lie pi / 2 focal lengths from the centre."""
    seen = camera("equidistant", [0.0] * 4).see(np.array([[2.0, 0.0, 0.0], [0.0, -1.0, -1.0], [0.0, 0.0, 5.0]]))
    expected = [[310 + 400 * np.pi / 2, 250], [310, 250 - 410 * 0.75 * np.pi], [310, 250]]
    assert_allclose(seen.pixels, expected)
    assert seen.valid.all()


def test_omnidirectional_is_mei():
    xi, k1, k2, p1, p2 = 1.4, -0.1, 0.03, 0.001, -0.002
    for point, (u, v) in zip(POINTS, camera("omnidirectional", [xi, k1, k2, p1, p2]).see(POINTS).pixels, strict=True):
        x, y, z = point / np.linalg.norm(point)
        x, y = x / (z + xi), y / (z + xi)
        r = x * x + y * y
        radial = 1 + k1 * r + k2 * r * r
        x, y = x * radial + 2 * p1 * x * y + p2 * (r + 2 * x * x), y * radial + p1 * (r + 2 * y * y) + 2 * p2 * x * y
        assert_allclose([u, v], [400 * x + 310, 410 * y + 250])


def test_double_sphere_is_usenko():
    xi, alpha = -0.2, 0.6
    for (x, y, z), (u, v) in zip(POINTS, camera("double_sphere", [xi, alpha]).see(POINTS).pixels, strict=True):
        d1 = np.sqrt(x * x + y * y + z * z)
        d2 = np.sqrt(x * x + y * y + (xi * d1 + z) ** 2)
        depth = alpha * d2 + (1 - alpha) * (xi * d1 + z)
        assert_allclose([u, v], [400 * x / depth + 310, 410 * y / depth + 250])


@pytest.mark.parametrize(
    ("model", "coefficients"), [("omnidirectional", [0.0] * 5), ("double_sphere", [0.0, 0.0]), ("plumb_bob", [0.0] * 4)]
)
def test_without_coefficients_a_lens_is_a_pinhole(model, coefficients):
    expected = POINTS @ MATRIX.T
    assert_allclose(camera(model, coefficients).see(POINTS).pixels, expected[:, :2] / expected[:, 2:])


def test_what_a_lens_cannot_show_is_not_valid():
    behind = np.array([[0.1, 0.0, -1.0]])
    wide = np.array([[4.0, 0.0, 1.0]])
    assert not camera("plumb_bob", [0.0] * 5).see(behind).valid.any()
    assert not camera("plumb_bob", [-0.3, 0.0, 0.0, 0.0]).see(wide).valid.any(), "the polynomial falls from 1.05 on"
    assert camera("plumb_bob", [-0.3, 0.0, 0.0, 0.0]).see(np.array([[1.0, 0.0, 1.0]])).valid.all()
    assert not camera("omnidirectional", [0.8, 0, 0, 0, 0]).see(behind).valid.any()
    assert not camera("double_sphere", [0.0, 0.0]).see(behind).valid.any()
    assert camera("double_sphere", [0.3, 0.6]).see(np.array([[1.0, 0.0, -0.1]])).valid.all()


def test_points_are_projected_through_the_lens_with_their_distance():
    points = np.array([[0.0, 3.0, 0.0, 0.5], [4.0, 0.0, 0.0, 0.5], [-4.0, 0.0, 0.0, 0.5]], np.float32)
    camera_from_lidar = np.array([[0.0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]])
    fisheye = CameraModel(1400, 480, MATRIX.copy(), "equidistant", np.zeros(4))
    fisheye.matrix[0, 2] = 700.0
    found = project_through(points, camera_from_lidar, fisheye)
    assert_array_equal(found.index, [0, 1])
    assert_allclose(found.pixels, [[700 - 400 * np.pi / 2, 250], [700, 250]], rtol=1e-6)
    assert_allclose(found.depth, [3, 4])


def test_a_pinhole_projects_as_ever():
    points = np.column_stack([POINTS[:, 2], POINTS[:, :2], np.ones(len(POINTS))]).astype(np.float32)
    camera_from_lidar = np.array([[0.0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]])
    pinhole = PinholeCamera(640, 480, MATRIX)
    ours, theirs = (
        project_through(points, camera_from_lidar, CameraModel.of(pinhole)),
        project(points, camera_from_lidar, pinhole),
    )
    assert_array_equal(ours.pixels, theirs.pixels)
    assert_array_equal(ours.index, theirs.index)


def test_every_model_says_how_many_coefficients_it_has_and_which_have_names():
    assert camera("omnidirectional", [1.2, 0.1, 0.2, 0.3, 0.4]).named == {"xi": 1.2}
    assert_array_equal(camera("omnidirectional", [1.2, 0.1, 0.2, 0.3, 0.4]).distortion, [0.1, 0.2, 0.3, 0.4])
    assert camera("double_sphere", [0.1, 0.5]).named == {"xi": 0.1, "alpha": 0.5}
    assert camera("equidistant", FISHEYE).named == {}
    assert COEFFICIENTS["rational_polynomial"] == (8, 12, 14)
