"""Changes of the mount, in what frames say: noise whose neighbours err alike, steps and drift of known size."""

from __future__ import annotations

import numpy as np
import pytest

from calibnet.drive.changes import SHORTEST, watch, without_outliers
from calibnet.geometry.types import Floats
from calibnet.trace import DriveLook
from calibnet.watch import WINDOW, Change

SIGMA = np.array([0.04, 0.05, 0.10, *np.radians([0.15, 0.15, 0.2])])
"""Of a frame: metres and radians."""
YAW = np.array([0, 0, 0, 0, np.radians(0.5), 0])
AHEAD = np.array([0, 0, 0.25, 0, 0, 0])


def noise(count: int, alike: float = 0.5, seed: int = 0) -> Floats:
    """What frames say ``[N, 6]`` of a mount that does not move; each errs ``alike`` its neighbour."""
    generator, errors = np.random.default_rng(seed), np.zeros((count, 6))
    errors[0] = generator.normal(size=6)
    for row in range(1, count):
        errors[row] = alike * errors[row - 1] + np.sqrt(1 - alike**2) * generator.normal(size=6)
    return np.asarray(errors * SIGMA)


def looks(said: Floats, first: int = 0) -> list[DriveLook]:
    return [DriveLook(first + row, row, offset) for row, offset in enumerate(said)]


def moved(said: Floats, at: int, by: Floats) -> Floats:
    return said + (np.arange(len(said)) >= at)[:, None] * by


@pytest.mark.parametrize("alike", [0.0, 0.5])
def test_a_mount_that_does_not_move_gives_no_alarm(alike: float) -> None:
    for seed in range(30):
        assert watch(looks(noise(60, alike, seed))).changes == ()


def test_a_drive_of_4541_frames_gives_no_alarm_and_a_step_in_it_is_found() -> None:
    said = noise(4541, 0.7)
    assert watch(looks(said)).changes == ()
    (change,) = watch(looks(moved(said, 3000, YAW))).changes
    assert abs(change.frame - 3000) <= 3 and change.rotation_deg == pytest.approx(0.5, abs=0.05)
    assert change.translation_cm < 2 and change.confidence > 0.999 and change.until is None


@pytest.mark.parametrize("by", [YAW, AHEAD], ids=["0.5 degrees", "25 cm"])
def test_a_step_is_found_when_twenty_frames_have_seen_it(by: Floats) -> None:
    found = []
    for seed in range(20):
        changes = watch(looks(moved(noise(100, 0.3, seed), 80, by), first=1000)).changes
        found.append(len(changes) == 1 and abs(changes[0].frame - 1080) <= 4)
    assert np.mean(found) >= 0.7


def test_two_steps_have_their_own_sizes() -> None:
    said = moved(moved(noise(150), 50, 2 * YAW), 100, 2 * AHEAD)
    first, second = watch(looks(said)).changes
    assert (abs(first.frame - 50), abs(second.frame - 100)) <= (2, 2)
    assert first.rotation_deg == pytest.approx(1.0, abs=0.15) and second.translation_cm == pytest.approx(50, abs=6)


def test_a_slow_drift_is_one_change_over_all_frames() -> None:
    drift = np.linspace(0, 1, 300)[:, None] * 2 * YAW
    (change,) = watch(looks(noise(300) + drift)).changes
    assert (change.frame, change.until) == (0, 299)
    assert change.rotation_deg == pytest.approx(1.0, abs=0.25) and change.confidence > 0.999


def test_single_frames_that_are_wrong_are_no_change() -> None:
    said = noise(80)
    said[[20, 41, 42, 60]] += [1.0, -1.0, 2.0, 0.1, 0.2, -0.1]
    assert watch(looks(said)).changes == ()
    assert np.abs(without_outliers(said)[20]).max() < 0.5


def test_the_windowed_estimate_lies_in_its_band() -> None:
    found = watch(looks(noise(400)))
    assert found.windowed.shape == found.sigma.shape == (400, 6)
    assert 0.85 < np.mean(np.abs(found.windowed) < 2 * found.sigma) <= 1
    np.testing.assert_allclose(found.windowed[200], found.offsets[200 - WINDOW // 2 : 200 + WINDOW // 2].mean(axis=0))
    np.testing.assert_allclose(found.smallest, np.sqrt(2) * found.sigma[200], rtol=1e-9)


def test_no_window_reaches_across_a_step() -> None:
    found = watch(looks(moved(noise(100), 50, 4 * YAW)))
    before, after = found.windowed[49, 4], found.windowed[50, 4]
    assert np.degrees(after - before) == pytest.approx(2.0, abs=0.25)
    assert found.sigma[49, 4] == pytest.approx(found.sigma[25, 4] * np.sqrt(WINDOW / (WINDOW // 2 + 1)), rel=0.01)


def test_too_few_frames_and_too_small_changes() -> None:
    with pytest.raises(ValueError, match="16 are needed"):
        watch(looks(noise(2 * SHORTEST - 1)))
    assert not Change(3, 0.2 * YAW, 1.0).matters and Change(3, YAW, 1.0).matters
    assert Change(3, 0.3 * AHEAD, 1.0).matters
