"""Halls of the synthetic world: same seed, same frame; closed all around; returns above the horizon."""

from __future__ import annotations

import numpy as np
import open3d as o3d
import pytest

from calibnet.datasets.synthetic import Hall, sample_hall, sample_robot_frame
from calibnet.geometry import project


def test_one_seed_gives_one_frame_and_another_gives_another() -> None:
    first, again, other = sample_robot_frame(3), sample_robot_frame(3), sample_robot_frame(4)
    assert np.array_equal(first.image, again.image) and np.array_equal(first.points, again.points)
    assert not np.array_equal(first.camera_from_lidar, other.camera_from_lidar)


@pytest.mark.parametrize("seed", range(4))
def test_nothing_is_seen_through_the_walls(seed: int) -> None:
    """Rays in all directions end within the hall, from the height of a robot's sensors."""
    hall = sample_hall(np.random.default_rng(seed))
    caster = o3d.t.geometry.RaycastingScene()
    corners = hall.everything.corners.reshape(-1, 3)
    caster.add_triangles(
        o3d.core.Tensor(corners), o3d.core.Tensor(np.arange(len(corners), dtype=np.uint32).reshape(-1, 3))
    )
    directions = np.random.default_rng(1).normal(size=(2000, 3)).astype(np.float32)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    origin = hall.place[:3, 3] + [0.0, 0.0, 1.2]
    rays = np.column_stack([np.broadcast_to(origin, directions.shape), directions]).astype(np.float32)
    distance = caster.cast_rays(o3d.core.Tensor(rays))["t_hit"].numpy()
    assert np.isfinite(distance).all()
    assert distance.max() < 75.0
    assert distance[directions[:, 2] > 0.9].max() < 9.0 / 0.9


def test_frames_are_whole_and_look_up_as_well_as_down() -> None:
    above, dark = [], []
    for seed in range(16):
        frame = sample_robot_frame(seed)
        assert frame.image.shape == (frame.camera.height, frame.camera.width, 3) and frame.camera.width <= 520
        assert np.isfinite(frame.points).all() and 0.0 <= frame.points[:, 3].min() <= frame.points[:, 3].max() <= 1.0
        seen = project(frame.points, frame.camera_from_lidar, frame.camera)
        assert len(seen.index) > 300
        above.append((frame.points[seen.index, 2] > 0.0).mean())
        dark.append(frame.image.mean() < 60)
    assert np.median(above) > 0.2  # of roads' frames almost none
    assert 0 < sum(dark) < 16


def test_there_are_garages_and_warehouses_high_and_low() -> None:
    halls: list[Hall] = [sample_hall(np.random.default_rng(seed)) for seed in range(30)]
    heights = [hall.everything.corners[..., 2].max() for hall in halls]
    assert {hall.kind for hall in halls} == {"room", "garage", "warehouse"}
    assert min(heights) < 3.0 and max(heights) > 5.0
