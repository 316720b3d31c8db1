"""What is known of an extrinsic: fixed axes keep their value, deviations count as one more measurement."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from calibnet.errors import ConfigError
from calibnet.geometry import euler_xyz, invert, miscalibration, rotation_from_vector, transform
from calibnet.geometry.prior import AXES, Prior, inverse, parse_angle, parse_axes, parse_length
from calibnet.geometry.se3 import pose_from_vector, pose_vector

INITIAL = transform(rotation_from_vector([0.1, 0.2, -0.1]) @ [[0, -1, 0], [0, 0, -1], [1, 0, 0]], [0.3, -0.2, -0.5])
RANDOM = np.random.default_rng(5)
INFORMATION = (lambda a: a @ a.T * 200 + 50 * np.eye(6))(RANDOM.normal(size=(6, 6)))


def named(delta: np.ndarray) -> dict[str, float]:
    pitch, yaw, roll = np.degrees(euler_xyz(delta[:3, :3]))
    return dict(zip(AXES, [roll, pitch, yaw, *delta[:3, 3]], strict=True))


@pytest.mark.parametrize("fixed", [("x", "y", "z"), ("roll",), ("pitch", "yaw"), ("roll", "pitch", "z")])
def test_fixed_axes_keep_their_value_exactly(fixed):
    """By the very angles of --miscalibrate, though the others turn by ten degrees, and after two corrections."""
    prior = Prior.of(fixed).about(INITIAL)
    before = miscalibration([9.0, -12.0, 10.0], [0.3, 0.2, -0.4]) @ INITIAL
    for _ in range(2):
        measured = pose_vector(miscalibration([-4.0, 7.0, -6.0], [0.2, -0.3, 0.1]))
        correction, covariance = prior.fused(measured, INFORMATION, before)
        before = pose_from_vector(correction) @ before
    found = named(before @ invert(INITIAL))
    for axis in AXES:
        assert (abs(found[axis]) < 1e-3) == (axis in fixed), (axis, found)
    assert (np.linalg.eigvalsh(covariance) > 0).all()


def test_fixed_offsets_keep_the_place_of_the_camera_in_the_lidar_frame():
    prior = Prior.of("xyz").about(INITIAL)
    correction = prior.corrected(miscalibration([3.0, -2.0, 1.0], [0.1, 0.2, 0.3]), INFORMATION, INITIAL)
    after = correction @ INITIAL
    assert_allclose(invert(after)[:3, 3], invert(INITIAL)[:3, 3], atol=1e-6)
    assert np.abs(after[:3, :3] - INITIAL[:3, :3]).max() > 0.01


def test_other_axes_are_the_best_under_what_is_fixed():
    """As of normal equations from which the fixed rows and columns are struck."""
    prior = Prior.of("xyz").about(INITIAL)
    measured = np.array([0.02, -0.01, 0.03, 0.002, -0.001, 0.003])
    correction, covariance = prior.fused(measured, INFORMATION, INITIAL)
    free = slice(3, 6)
    expected = np.linalg.solve(INFORMATION[free, free], (INFORMATION @ measured)[free])
    assert_allclose(correction[free], expected, atol=1e-5)
    assert_allclose(covariance[free, free], np.linalg.inv(INFORMATION[free, free]), rtol=1e-3)


def test_a_deviation_counts_as_a_measurement_of_the_start():
    prior = Prior.of((), translation_m=0.02).about(INITIAL)
    information = np.diag([1 / 0.01**2] * 3 + [1 / 0.001**2] * 3)
    correction, covariance = prior.fused(np.array([0.05, 0, 0, 0, 0, 0]), information, INITIAL)
    assert correction[0] == pytest.approx(0.05 * 0.02**2 / (0.02**2 + 0.01**2))
    assert covariance[0, 0] == pytest.approx(1 / (1 / 0.01**2 + 1 / 0.02**2))
    moved = transform(np.eye(3), [0.04, 0, 0]) @ INITIAL
    correction, _ = prior.fused(np.zeros(6), information, moved)
    assert correction[0] == pytest.approx(-0.04 * 0.01**2 / (0.02**2 + 0.01**2)), "back towards the start"


def test_what_is_known_is_of_the_real_camera_where_the_image_is_turned():
    """A camera on its side: its x is the turned camera's y."""
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    prior = Prior.of(["x"]).about(INITIAL).turned(quarter)
    before = transform(quarter, np.zeros(3)) @ INITIAL
    correction = prior.corrected(transform(np.eye(3), [0.1, 0.2, 0.3]), np.eye(6), before)
    assert_allclose(correction[:3, 3], [0.1, 0.0, 0.3], atol=1e-6)
    after = transform(quarter.T, np.zeros(3)) @ correction @ before
    assert named(after @ invert(INITIAL))["x"] == pytest.approx(0.0, abs=1e-6)


def test_a_covariance_is_narrowed():
    covariance = inverse(INFORMATION)
    narrowed = Prior.of("xyz").about(INITIAL).narrowed(covariance, INITIAL)
    assert np.sqrt(np.trace(narrowed[:3, :3])) < 1e-4
    assert (np.diag(narrowed) <= np.diag(covariance) + 1e-12).all()


def test_nothing_known_is_false_and_words_say_what_is():
    assert not Prior()
    assert not Prior.of()
    assert Prior.of(["z", "roll"], 0.02, np.radians(0.5)).words == "known to 2 cm; known to 0.5°; roll, z fixed"


@pytest.mark.parametrize(("fixed", "problem"), [(["w"], "'w' is not an axis"), (AXES, "all six axes fixed")])
def test_what_cannot_be_fixed(fixed, problem):
    with pytest.raises(ConfigError, match=problem):
        Prior.of(fixed)


def test_texts():
    assert parse_length("2cm") == pytest.approx(0.02)
    assert parse_length(" 15 mm ") == pytest.approx(0.015)
    assert parse_angle("0.5deg") == pytest.approx(np.radians(0.5))
    assert parse_angle("2 mrad") == pytest.approx(0.002)
    assert parse_axes("x, y,z") == ("x", "y", "z")
    assert parse_axes("['roll', 'x']") == ("roll", "x")
    for parse, text in ((parse_length, "2"), (parse_length, "2deg"), (parse_angle, "-1deg"), (parse_angle, "0deg")):
        with pytest.raises(ConfigError, match="with a unit; write for instance"):
            parse(text)
    assert parse_axes("[]") == ()
    for text, name in (("x,q", "q"), ("", ""), ("x,,y", ""), ("x,", "")):  # "$AXES" of a shell may be empty
        with pytest.raises(ConfigError, match=f"'{name}' is not an axis"):
            parse_axes(text)
