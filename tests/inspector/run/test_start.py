"""Where calibrations start: one draw for the run, one a frame, a given one, or the data as it is."""

from __future__ import annotations

from types import ModuleType

import numpy as np
import pytest

from calibnet.geometry import MiscalibrationRange, euler_xyz, invert, miscalibration, pose_error
from inspector.run.start import Start

RANGE = MiscalibrationRange(5.0, 0.5)


def deltas(start: Start, fakes: ModuleType, count: int = 4) -> list[np.ndarray]:
    frames = [fakes.make_frame(index, points=10) for index in range(count)]
    return [start.initial(frame) @ invert(frame.camera_from_lidar) for frame in frames]


def test_one_draw_for_the_run_within_the_range(fakes: ModuleType) -> None:
    first, *others = deltas(Start(RANGE, seed=3), fakes)
    for other in others:
        np.testing.assert_allclose(other, first, atol=1e-12)
    assert np.degrees(np.abs(euler_xyz(first[:3, :3]))).max() <= 5.0
    assert np.abs(first[:3, 3]).max() <= 0.5
    assert pose_error(first, np.eye(4)).rotation_deg > 0.1


def test_per_frame_draws_depend_on_the_frame_not_on_the_order(fakes: ModuleType) -> None:
    start = Start(RANGE, seed=3, per_frame=True)
    drawn = deltas(start, fakes)
    assert not np.allclose(drawn[0], drawn[1])
    frame = fakes.make_frame(2, points=10)
    np.testing.assert_allclose(start.initial(frame) @ invert(frame.camera_from_lidar), drawn[2], atol=1e-12)


def test_another_seed_draws_another(fakes: ModuleType) -> None:
    assert not np.allclose(deltas(Start(RANGE, seed=1), fakes)[0], deltas(Start(RANGE, seed=2), fakes)[0])


def test_given_miscalibration_is_used_and_decides_the_stages(fakes: ModuleType) -> None:
    given = miscalibration([1.5, 0.0, 0.0], [0.0, 0.1, 0.0])
    start = Start(RANGE, given=given)
    np.testing.assert_allclose(deltas(start, fakes)[0], given, atol=1e-12)
    assert start.stages == (4, 5)


@pytest.mark.parametrize(("range_", "stages"), [((20, 1.5), (1, 2, 3, 4, 5)), ((5, 0.5), (3, 4, 5)), ((1, 0.1), (5,))])
def test_stages_are_those_within_the_range(range_: tuple[float, float], stages: tuple[int, ...]) -> None:
    assert Start(MiscalibrationRange(*range_)).stages == stages


def test_as_it_is_has_no_reference(fakes: ModuleType) -> None:
    frame = fakes.make_frame(0, points=10)
    start = Start(RANGE, as_is=True)
    np.testing.assert_array_equal(start.initial(frame), frame.camera_from_lidar)
    assert start.reference(frame) is None
    np.testing.assert_array_equal(Start(RANGE).reference(frame), frame.camera_from_lidar)
