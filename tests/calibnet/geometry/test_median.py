"""The median of extrinsics: where outliers leave it, and that it does not depend on the frame of reference."""

from __future__ import annotations

import numpy as np
import pytest

from calibnet.geometry import miscalibration, pose_error, rotation_angle, transform
from calibnet.geometry.median import geometric_median, median_pose

MOUNT = transform([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]], [0.06, -0.08, -0.27])


def scattered(count: int, degrees: float, metres: float, seed: int = 0) -> list[np.ndarray]:
    generator = np.random.default_rng(seed)
    draws = generator.normal(size=(count, 2, 3))
    return [miscalibration(degrees * draw[0], metres * draw[1]) @ MOUNT for draw in draws]


def test_a_third_of_wild_frames_hardly_move_it() -> None:
    wild = [miscalibration([25.0, 20.0, -30.0], [2.0, 1.0, -3.0]) @ MOUNT] * 10
    error = pose_error(median_pose([*scattered(20, 0.1, 0.01), *wild]), MOUNT)
    assert error.rotation_deg < 0.15
    assert error.translation_cm < 1.5


def test_it_minimises_the_sum_of_distances() -> None:
    poses = scattered(9, 3.0, 0.3)
    best = median_pose(poses)

    def costs(pose: np.ndarray) -> tuple[float, float]:
        angles = [rotation_angle(pose[:3, :3] @ other[:3, :3].T) for other in poses]
        return sum(angles), sum(float(np.linalg.norm(pose[:3, 3] - other[:3, 3])) for other in poses)

    rotation, translation = costs(best)
    for nudge in scattered(30, 0.05, 0.005, seed=1):
        other = nudge @ np.linalg.inv(MOUNT) @ best
        assert costs(other)[0] > rotation - 1e-6
        assert costs(transform(best[:3, :3], nudge[:3, 3] - MOUNT[:3, 3] + best[:3, 3]))[1] > translation - 1e-6


def test_one_and_the_same_pose_is_its_own_median() -> None:
    for poses in ([MOUNT], [MOUNT] * 5):
        np.testing.assert_allclose(median_pose(poses), MOUNT, atol=1e-15)


def test_turning_the_axes_turns_the_median() -> None:
    """A median taken axis by axis would not."""
    points = np.random.default_rng(2).normal(size=(11, 3)) * [1.0, 5.0, 0.2]
    turn = miscalibration([30.0, -40.0, 50.0], [0.0, 0.0, 0.0])[:3, :3]
    np.testing.assert_allclose(geometric_median(points @ turn.T), turn @ geometric_median(points), atol=1e-6)


def test_of_nothing_there_is_no_median() -> None:
    with pytest.raises(ValueError, match="no extrinsics"):
        median_pose([])
