"""The synthetic world: same seed, same frame; LiDAR and camera agree; worlds and rigs vary."""

from __future__ import annotations

import dataclasses

import numpy as np
import open3d as o3d
import pytest

from calibnet.conformance import check_dataset
from calibnet.datasets.frame import Sequence
from calibnet.datasets.synthetic import (
    KITTI_LIKE,
    SyntheticSequence,
    World,
    render_frame,
    sample_frame,
    sample_rig,
    sample_scene,
)
from calibnet.datasets.synthetic.style import KINDS
from calibnet.errors import ConfigError
from calibnet.geometry import PinholeCamera, project

SMALL = dataclasses.replace(
    KITTI_LIKE,
    camera=KITTI_LIKE.camera.resized(310, 94),
    lidar=dataclasses.replace(KITTI_LIKE.lidar, azimuth_step=np.radians(0.8)),
)


def assert_same(a, b):
    np.testing.assert_array_equal(a.image, b.image)
    np.testing.assert_array_equal(a.points, b.points)
    np.testing.assert_array_equal(a.camera_from_lidar, b.camera_from_lidar)
    np.testing.assert_array_equal(a.camera.matrix, b.camera.matrix)


def test_one_seed_gives_one_frame_and_another_gives_another():
    first, again, other = sample_frame(3), sample_frame(3), sample_frame(4)
    assert_same(first, again)
    assert not np.array_equal(first.camera_from_lidar, other.camera_from_lidar)
    assert first.image.shape != other.image.shape or (first.image != other.image).mean() > 0.5


@pytest.mark.parametrize("seed", [5, 6, 7, 8])
def test_training_frames_are_whole(seed):
    frame = sample_frame(seed)
    assert frame.image.dtype == np.uint8
    assert frame.image.shape == (frame.camera.height, frame.camera.width, 3)
    assert frame.camera.width <= 660
    assert frame.points.dtype == np.float32
    assert frame.points.shape[1] == 4
    assert np.isfinite(frame.points).all()
    assert 0.0 <= frame.points[:, 3].min() < frame.points[:, 3].max() <= 1.0
    assert len(project(frame.points, frame.camera_from_lidar, frame.camera).index) > 300
    assert frame.image.std() > 10.0
    rotation = frame.camera_from_lidar[:3, :3]
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(rotation) > 0.0


@pytest.mark.parametrize("seed", [21, 22])
def test_points_lie_on_what_the_camera_sees(seed):
    """Cast the camera's own ray through every projected point: its depth must be the point's.

    The reference is computed with Open3D's pinhole model and the world's triangles, without the
    package's ray or projection code.
    """
    generator = np.random.default_rng(seed)
    scene, rig = sample_scene(generator), sample_rig(generator)
    world, pose = World(scene), scene.pose(60.0)
    frame = render_frame(world, rig, pose, generator)
    homogeneous = np.column_stack([frame.points[:, :3].astype(np.float64), np.ones(len(frame.points))])
    in_camera = (homogeneous @ frame.camera_from_lidar.T)[:, :3]
    in_camera = in_camera[in_camera[:, 2] > 1.0]
    pixel = in_camera @ frame.camera.matrix.T
    pixel = pixel[:, :2] / pixel[:, 2:]
    seen = (pixel > 0).all(1) & (pixel[:, 0] < frame.camera.width - 1) & (pixel[:, 1] < frame.camera.height - 1)
    depth, pixel = in_camera[seen, 2], pixel[seen]

    camera_from_world = frame.camera_from_lidar @ np.linalg.inv(pose @ rig.vehicle_from_lidar)
    mesh = world.mesh(pose, 0.0)
    caster = o3d.t.geometry.RaycastingScene()
    vertices = mesh.corners.reshape(-1, 3)
    caster.add_triangles(
        o3d.core.Tensor(vertices), o3d.core.Tensor(np.arange(len(vertices), dtype=np.uint32).reshape(-1, 3))
    )
    scale = 4  # rays at a quarter of a pixel
    matrix = np.diag([scale, scale, 1.0]) @ frame.camera.matrix
    rays = caster.create_rays_pinhole(
        o3d.core.Tensor(matrix + np.array([[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]])),  # Open3D's centres are at halves
        o3d.core.Tensor(camera_from_world),
        scale * frame.camera.width,
        scale * frame.camera.height,
    )
    hit = caster.cast_rays(rays)["t_hit"].numpy()  # rays have z = 1: the parameter is the depth
    cell = np.round(scale * pixel).astype(int)
    error = np.abs(hit[cell[:, 1], cell[:, 0]] - depth)
    assert len(error) > 500
    assert np.median(error) < 3.0 * rig.lidar.range_noise
    # Occlusion between the two sensors and depth edges explain the rest.
    assert (error < 0.3).mean() > 0.8


def test_image_edges_follow_the_scene_and_not_a_shifted_camera():
    """Depth edges of the scan coincide with image gradients better at the true extrinsic than beside it."""
    scores = []
    for seed in range(30, 36):
        frame = sample_frame(seed)
        grey = frame.image.astype(np.float32).mean(axis=2)
        gradient = np.abs(np.diff(grey, axis=1, prepend=grey[:, :1]))
        flat = project(frame.points, frame.camera_from_lidar, frame.camera)
        order = np.lexsort((flat.pixels[:, 0], np.round(flat.pixels[:, 1])))
        u, v = flat.pixels[order].T
        depth = flat.depth[order]
        jump = (np.abs(np.diff(v)) < 1) & (np.abs(np.diff(u)) < 4) & (depth[1:] / depth[:-1] < 0.8)
        column, row = np.round(u[1:][jump]).astype(int), np.round(v[1:][jump]).astype(int)
        width = frame.camera.width

        def mean_gradient(shift, gradient=gradient, row=row, column=column, width=width):
            near = [gradient[row, np.clip(column + shift + k, 0, width - 1)] for k in (-1, 0)]
            return float(np.max(near, axis=0).mean())

        beside = 0.5 * (mean_gradient(-15) + mean_gradient(15))
        scores.append(mean_gradient(0) / beside)
    assert np.median(scores) > 1.2


def test_scan_stays_within_its_sector_of_the_camera_axis():
    frame = sample_frame(11)
    axis = frame.camera_from_lidar[2, :2]
    cosine = frame.points[:, :2] @ (axis / np.linalg.norm(axis)) / np.linalg.norm(frame.points[:, :2], axis=1)
    assert np.degrees(np.arccos(np.clip(cosine, -1, 1))).max() < 71.0


def test_rigs_and_places_vary():
    rigs = [sample_rig(np.random.default_rng(seed)) for seed in range(150)]
    beams = {len(rig.lidar.elevation) for rig in rigs}
    assert {16, 32, 40, 64, 128} <= beams
    positions = np.array([-rig.camera_from_lidar[:3, :3].T @ rig.camera_from_lidar[:3, 3] for rig in rigs])
    assert np.abs(positions).max() <= 1.2 + 1e-9
    assert (positions.std(axis=0) > 0.15).all()
    heading = np.array([rig.camera_from_lidar[2, 0] for rig in rigs])
    assert (heading > 0.9).mean() > 0.5
    assert (heading < 0.3).any()
    fields = [np.degrees(2 * np.arctan(0.5 * rig.camera.width / rig.camera.focal[0])) for rig in rigs]
    assert min(fields) < 55.0
    assert max(fields) > 90.0
    aspects = [rig.camera.width / rig.camera.height for rig in rigs]
    assert min(aspects) < 1.5
    assert max(aspects) > 3.0
    kinds = {sample_scene(np.random.default_rng(seed)).style.kind for seed in range(80)}
    assert kinds == set(KINDS)


def test_most_points_are_at_driving_distances():
    depths = np.concatenate(
        [project(f.points, f.camera_from_lidar, f.camera).depth for f in (sample_frame(seed) for seed in range(50, 60))]
    )
    low, middle, high = np.percentile(depths, [5, 50, 95])
    assert low > 2.0
    assert 6.0 < middle < 25.0
    assert 25.0 < high < 90.0


@pytest.mark.parametrize("kind", KINDS)
def test_ground_has_no_holes(kind):
    """A plumb line dropped anywhere near the road meets the swept ground."""
    from calibnet.datasets.synthetic.ground import cross_section

    scene = next(
        scene
        for scene in (sample_scene(np.random.default_rng(seed)) for seed in range(300))
        if scene.style.kind == kind and scene.style.rough > 0.02
    )
    vertices = np.concatenate(
        [part.corners for k in range(5) for part in cross_section(scene, 20.0 * k, 20.0 * k + 20.0)]
    )
    caster = o3d.t.geometry.RaycastingScene()
    triangles = np.arange(vertices.size // 3, dtype=np.uint32).reshape(-1, 3)
    caster.add_triangles(o3d.core.Tensor(vertices.reshape(-1, 3)), o3d.core.Tensor(triangles))
    generator = np.random.default_rng(0)
    start = scene.line.place(generator.uniform(5, 95, 4000), generator.uniform(-45, 45, 4000), 30.0)
    down = np.broadcast_to([0.0, 0.0, -1.0], start.shape)
    drop = caster.cast_rays(o3d.core.Tensor(np.hstack([start, down]).astype(np.float32)))["t_hit"].numpy()
    assert np.isfinite(drop).all()
    # Strips meet without a step: along a line across the road the ground nowhere jumps by more than a kerb.
    lateral = np.arange(-40.0, 40.0, 0.05)
    across = scene.line.place(np.full(len(lateral), 51.0), lateral, 30.0)
    down = np.broadcast_to([0.0, 0.0, -1.0], across.shape)
    profile = caster.cast_rays(o3d.core.Tensor(np.hstack([across, down]).astype(np.float32)))["t_hit"].numpy()
    assert np.abs(np.diff(profile)).max() < 0.22


def test_prototypes_stand_on_the_ground():
    from calibnet.datasets.synthetic.library import library

    for name, variants in library().items():
        for near, far in variants:
            for mesh in (near, far):
                low, high = mesh.corners.min(axis=(0, 1)), mesh.corners.max(axis=(0, 1))
                assert np.isfinite(mesh.corners).all(), name
                assert -1.1 <= low[2] <= 0.12, name
                assert 0.3 < high[2] < 20.0, name
            assert len(far) <= len(near), name


def test_lane_paint_returns_more_than_asphalt():
    from calibnet.datasets.synthetic.textures import atlas

    tiles = atlas()
    first = tiles.texels[: len(tiles.tile_metres) * 256 * 256].reshape(-1, 256 * 256, 4)[..., 3].mean(axis=1)
    assert first[list(tiles.groups["paint"])].min() > 3.0 * first[list(tiles.groups["asphalt"])].max()


def test_sequence_keeps_the_promises_of_a_dataset():
    check_dataset(lambda: SyntheticSequence(5, 2, SMALL))


def test_sequence_keeps_the_protocol_whatever_is_read_first():
    sequence = SyntheticSequence(5, 6, SMALL)
    assert isinstance(sequence, Sequence)
    assert len(sequence) == 6
    assert sequence.rig == SMALL.name
    last = sequence[-1]
    assert (last.index, last.timestamp) == (5, pytest.approx(0.5))
    fresh = SyntheticSequence(5, 6, SMALL)
    assert_same(fresh[2], sequence[2])
    assert_same(fresh[5], last)
    assert not np.array_equal(fresh[1].image, fresh[2].image)
    with pytest.raises(IndexError):
        sequence[6]
    with pytest.raises(ConfigError, match="length"):
        SyntheticSequence(5, 0)


def test_sequence_drives_about_a_metre_a_frame_on_gentle_curves():
    sequence = SyntheticSequence(9, 200, SMALL)
    poses = np.array([sequence.world_from_vehicle(position) for position in range(200)])
    steps = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1)
    assert steps.min() > 0.8
    assert steps.max() < 1.2
    turn = np.einsum("nij,nij->n", poses[:-1, :3, :3], poses[1:, :3, :3])
    assert np.degrees(np.arccos(np.clip((turn - 1) / 2, -1, 1))).max() < 3.0


def test_memory_of_a_long_drive_stays_bounded():
    sequence = SyntheticSequence(2, 3000, SMALL)
    for position in range(0, 3000, 150):
        sequence.world.mesh(sequence.world_from_vehicle(position), 0.1 * position)
    assert 0 < len(sequence.world._chunks) <= 24


def test_own_camera_sees_what_a_resized_one_sees():
    """The same scene at half the resolution is the same image, resized: rays go through pixel centres."""
    import cv2

    exposure = dataclasses.replace(SyntheticSequence(1, 1, SMALL).exposure, noise=0.0, quality=0, blur=0.3)
    world = World(sample_scene(np.random.default_rng(1)))
    large = dataclasses.replace(
        SMALL, camera=PinholeCamera(640, 200, np.array([[400.0, 0, 315], [0, 400, 95], [0, 0, 1]]))
    )
    small = dataclasses.replace(large, camera=large.camera.resized(320, 100))
    a, b = (
        render_frame(world, rig, world.scene.pose(80.0), np.random.default_rng(0), exposure=exposure).image
        for rig in (large, small)
    )
    halved = cv2.resize(a, (320, 100), interpolation=cv2.INTER_AREA).astype(np.float32)
    errors = {}
    for shift in (-1, 0, 1):
        errors[shift] = np.abs(np.roll(halved, shift, axis=1) - b)[:, 2:-2].mean()
    assert errors[0] < 0.7 * min(errors[-1], errors[1])
