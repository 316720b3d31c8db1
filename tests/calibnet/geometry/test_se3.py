"""Rotations against other ways to compute them: OpenCV's Rodrigues, the matrix exponential, arccos."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose

from calibnet.geometry import (
    degrees_and_cm,
    euler_xyz,
    invert,
    pose_error,
    rotation_angle,
    rotation_from_euler_xyz,
    transform,
    transform_points,
)
from calibnet.geometry.se3 import rotation_vector


def about(axis: int, angle: float) -> np.ndarray:
    """A rotation about one axis by the exponential series of its cross-product matrix."""
    cross = np.zeros((3, 3))
    cross[(axis + 1) % 3, (axis + 2) % 3] = -1.0
    cross[(axis + 2) % 3, (axis + 1) % 3] = 1.0
    total, term = np.eye(3), np.eye(3)
    for order in range(1, 30):
        term = term @ (angle * cross) / order
        total = total + term
    return total


def random_rigid(generator: np.random.Generator) -> np.ndarray:
    return transform(cv2.Rodrigues(generator.normal(size=3))[0], generator.normal(size=3))


@pytest.mark.parametrize("axis", [[1, 0, 0], [0, 1, 0], [0, 0, -1], [1, -2, 3], [-3, 1, 1e-9]])
@pytest.mark.parametrize("short_of_half_a_turn", [0.0, 1e-13, 1e-9, 1e-6, 0.1, 0.2])
def test_a_rotation_vector_is_as_long_as_the_angle_up_to_half_a_turn(
    axis: list[float], short_of_half_a_turn: float
) -> None:
    vector = (np.pi - short_of_half_a_turn) * np.array(axis) / np.linalg.norm(axis)
    rotation = cv2.Rodrigues(vector)[0]
    found = rotation_vector(rotation)
    assert np.linalg.norm(found) == pytest.approx(rotation_angle(rotation), abs=1e-12)
    assert_allclose(cv2.Rodrigues(found)[0], rotation, atol=1e-14 if short_of_half_a_turn > 0.01 else 1e-9)
    if short_of_half_a_turn > 1e-8:
        assert_allclose(found, vector, atol=1e-7)


def test_half_turns_about_the_axes() -> None:
    assert_allclose(rotation_vector(np.diag([1.0, -1.0, -1.0])), [np.pi, 0, 0])
    assert_allclose(np.abs(rotation_vector(np.diag([-1.0, -1.0, 1.0]))), [0, 0, np.pi])


ANGLES = np.random.default_rng(0).uniform(-1.4, 1.4, (20, 3))


@pytest.mark.parametrize("angles", ANGLES)
def test_euler_angles_turn_about_x_then_y_then_z_from_the_left(angles):
    a, b, c = angles
    assert_allclose(rotation_from_euler_xyz(angles), about(0, a) @ about(1, b) @ about(2, c), atol=1e-14)


@pytest.mark.parametrize("angles", ANGLES)
def test_euler_angles_survive_the_round_trip(angles):
    assert_allclose(euler_xyz(rotation_from_euler_xyz(angles)), angles, atol=1e-12)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-5, 0.01, 0.35, 1.5, 3.0, math.pi])
def test_rotation_angle_is_exact_from_zero_to_half_a_turn(angle):
    axis = np.array([0.36, -0.48, 0.8])
    rotation = np.eye(3) if angle == 0.0 else cv2.Rodrigues(angle * axis)[0]
    assert rotation_angle(rotation) == pytest.approx(angle, rel=1e-6, abs=1e-12)


def test_transform_points_against_a_loop_and_keeps_precision():
    generator = np.random.default_rng(3)
    matrix = random_rigid(generator)
    points = generator.normal(size=(7, 3))
    by_hand = [
        [sum(matrix[row, k] * point[k] for k in range(3)) + matrix[row, 3] for row in range(3)] for point in points
    ]
    assert_allclose(transform_points(matrix, points), by_hand, rtol=1e-13)
    assert transform_points(matrix, points.astype(np.float32)).dtype == np.float32
    assert_allclose(transform_points(matrix, points.astype(np.float32)), by_hand, atol=1e-5)


def test_invert_is_the_matrix_inverse():
    matrix = random_rigid(np.random.default_rng(4))
    assert_allclose(invert(matrix), np.linalg.inv(matrix), atol=1e-14)


def test_pose_error_of_equal_poses_is_zero():
    matrix = random_rigid(np.random.default_rng(5))
    error = pose_error(matrix, matrix)
    assert error.rotation_deg < 1e-10
    assert error.translation_cm == 0.0


@pytest.mark.parametrize(("axis", "name"), [(0, "pitch_deg"), (1, "yaw_deg"), (2, "roll_deg")])
def test_pose_error_names_the_camera_axis_that_turned(axis, name):
    reference = random_rigid(np.random.default_rng(6))
    delta = np.eye(4)
    delta[:3, :3] = about(axis, math.radians(-3.0))
    error = pose_error(delta @ reference, reference)
    assert error.rotation_deg == pytest.approx(3.0)
    for other in ("roll_deg", "pitch_deg", "yaw_deg"):
        assert getattr(error, other) == pytest.approx(-3.0 if other == name else 0.0, abs=1e-9)


def test_pose_error_against_arccos_and_the_norm():
    """The definition of the field: angle of ``R_est R_ref^T`` by its trace, distance of the translations."""
    generator = np.random.default_rng(7)
    for _ in range(20):
        estimate, reference = random_rigid(generator), random_rigid(generator)
        trace = sum(float(estimate[row, :3] @ reference[row, :3]) for row in range(3))
        error = pose_error(estimate, reference)
        assert error.rotation_deg == pytest.approx(math.degrees(math.acos((trace - 1.0) / 2.0)), rel=1e-9)
        offset = [100.0 * (estimate[k, 3] - reference[k, 3]) for k in range(3)]
        assert [error.x_cm, error.y_cm, error.z_cm] == pytest.approx(offset)
        assert error.translation_cm == pytest.approx(math.dist(offset, [0, 0, 0]))


def test_the_size_of_a_pose_is_written_with_its_units() -> None:
    assert degrees_and_cm(0.274, 11.02) == "0.27° / 11.0 cm"
    assert degrees_and_cm(None, 1.0) == ""
