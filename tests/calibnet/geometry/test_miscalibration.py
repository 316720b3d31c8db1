"""Miscalibrations: range_, uniformity, seeds, and which camera axis an angle turns about."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from calibnet.errors import ConfigError
from calibnet.geometry import (
    RANGES,
    MiscalibrationRange,
    miscalibration,
    pose_error,
    range_of,
    sample_miscalibration,
    stages_within,
)


def samples(range_: MiscalibrationRange, count: int = 3000) -> tuple[np.ndarray, np.ndarray]:
    """Per-axis angles in degrees ``[N, 3]`` and metres ``[N, 3]``, read off as a pose error."""
    generator = np.random.default_rng(11)
    errors = [pose_error(sample_miscalibration(range_, generator), np.eye(4)) for _ in range(count)]
    angles = np.array([[error.roll_deg, error.pitch_deg, error.yaw_deg] for error in errors])
    return angles, np.array([[error.x_cm, error.y_cm, error.z_cm] for error in errors]) / 100.0


@pytest.mark.parametrize("range_", RANGES, ids=str)
def test_samples_fill_the_bounds_uniformly_on_every_axis(range_):
    for values, limit in zip(samples(range_), (range_.rotation_deg, range_.translation_m), strict=True):
        unit = values / limit
        assert (np.abs(unit) <= 1.0 + 1e-9).all()
        assert (np.abs(unit).max(axis=0) > 0.99).all()
        assert_allclose(unit.mean(axis=0), 0.0, atol=0.05)
        assert_allclose(unit.std(axis=0), 1 / np.sqrt(3), atol=0.03)  # of a uniform distribution
        assert_allclose(np.corrcoef(unit.T), np.eye(3), atol=0.06)


def test_rotation_and_translation_are_drawn_independently():
    angles, metres = samples(RANGES[0])
    assert_allclose(np.corrcoef(angles.T, metres.T)[:3, 3:], 0.0, atol=0.06)


def test_one_seed_gives_one_miscalibration():
    draw = [sample_miscalibration(RANGES[2], np.random.default_rng(seed)) for seed in (5, 5, 6)]
    assert_array_equal(draw[0], draw[1])
    assert not np.allclose(draw[0], draw[2])


def test_five_ranges_of_the_paper():
    assert [str(range_) for range_ in RANGES] == ["20/1.5", "10/1", "5/0.5", "2/0.2", "1/0.1"]


@pytest.mark.parametrize(
    ("angles", "seen", "moved"),
    [
        ((90, 0, 0), [1, 0, 0], [0, 1, 0]),  # roll, about forward: right turns down
        ((0, 90, 0), [0, 1, 0], [0, 0, 1]),  # pitch, about right: down turns forward
        ((0, 0, 90), [0, 0, 1], [1, 0, 0]),  # yaw, about down: forward turns right
    ],
)
def test_angles_turn_about_the_axes_of_the_camera(angles, seen, moved):
    delta = miscalibration(angles, [1.0, 2.0, 3.0])
    assert_allclose(delta[:3, :3] @ seen, moved, atol=1e-15)
    assert_array_equal(delta[:, 3], [1.0, 2.0, 3.0, 1.0])


def test_text_to_range():
    assert MiscalibrationRange.parse("5/0.5") == MiscalibrationRange(5.0, 0.5)
    assert str(MiscalibrationRange.parse("20.0/1.50")) == "20/1.5"


@pytest.mark.parametrize("text", ["", "5", "5/0.5/1", "a/b", "-5/0.5", "5/-1", "nan/1", "1/inf", "60/1"])
def test_malformed_range(text):
    with pytest.raises(ConfigError, match=r"Range"):
        MiscalibrationRange.parse(text)


def test_label_for_people():
    assert [range_.label for range_ in RANGES[:3]] == ["±20°/1.5 m", "±10°/1 m", "±5°/0.5 m"]


def test_information_is_the_inverse_variance_of_what_is_drawn():
    information = MiscalibrationRange(5, 0.5).information
    assert information.shape == (6, 6) and information.dtype == np.float64
    assert_array_equal(information, np.diag(np.diag(information)))
    metres, radians = np.diag(information)[[0, 5]]
    assert metres == pytest.approx(12.0)  # 3 / 0.5²
    assert radians == pytest.approx(3 / np.radians(5) ** 2)
    assert_array_equal(information, information.astype(np.float32))
    drawn = [sample_miscalibration(MiscalibrationRange(5, 0.5), np.random.default_rng(seed)) for seed in range(2000)]
    assert np.var([delta[0, 3] for delta in drawn]) == pytest.approx(1 / metres, rel=0.05)


def test_nothing_is_known_beyond_doubt():
    assert_allclose(np.diag(MiscalibrationRange(0, 0).information), 1e8, rtol=1e-6)


def test_bounds_of_a_given_miscalibration():
    range_ = range_of(miscalibration([1.0, -4.5, 2.0], [0.1, -0.3, 0.05]))
    assert range_.rotation_deg == pytest.approx(4.5)
    assert range_.translation_m == pytest.approx(0.3)


@pytest.mark.parametrize(
    ("text", "stages"),
    [
        ("20/1.5", (1, 2, 3, 4, 5)),
        ("5/0.5", (3, 4, 5)),
        ("1/0.1", (5,)),
        ("0/0", (5,)),
        ("3/0.1", (3, 4, 5)),
        ("1/0.5", (3, 4, 5)),
        ("45/3", (1, 2, 3, 4, 5)),
    ],
)
def test_stages_of_a_starting_range(text, stages):
    assert stages_within(MiscalibrationRange.parse(text)) == stages
