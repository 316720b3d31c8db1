"""PCBA: the adjustment on exact tracks and planes, the odometry on a known motion, the whole on a synthetic drive."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calibnet.conformance import check_method
from calibnet.datasets.synthetic import KITTI_LIKE, SyntheticSequence
from calibnet.errors import CalibrationError
from calibnet.geometry import MiscalibrationRange, PinholeCamera, invert, miscalibration, pose_error, transform
from calibnet.geometry.se3 import pose_from_vector, transform_points
from calibnet.geometry.types import Floats, Transform
from calibnet.methods.pcba import PCBA
from calibnet.methods.pcba.adjustment import Problem, seen
from calibnet.methods.pcba.planes import Planes, planes_of
from calibnet.methods.pcba.tracks import Tracks
from calibnet.motion.odometry import longest_run, path
from tests.support.boxes import boxes

CAMERA = PinholeCamera(1200, 400, np.array([[700.0, 0, 600], [0, 700.0, 190], [0, 0, 1]]))
REFERENCE = transform([[0, -1, 0], [0, 0, -1], [1, 0, 0]], [0.05, -0.1, -0.3])
KNOWN = np.array([0.3] * 3 + [0.05] * 3)
STEPS = 6


def room(generator: np.random.Generator, count: int = 400) -> Planes:
    """Points on a floor, a wall to either side and one ahead, in the world frame."""
    ahead, left, up = generator.uniform([8, -6, -1.5], [30, 6, 4], (count, 3)).T
    side = np.arange(count) % 4
    left = np.select([side == 1, side == 2], [-6.0, 6.0], left)
    up, ahead = np.where(side == 0, -1.5, up), np.where(side == 3, 32.0, ahead)
    normals = np.array([[0.0, 0, 1], [0, 1, 0], [0, -1, 0], [-1, 0, 0]])[side]
    return Planes(np.stack([ahead, left, up], axis=1), normals)


def poses(turn: float = 0.06) -> list[Transform]:
    """``world_from_lidar`` of a car that drives a metre a frame and turns."""
    step = pose_from_vector(np.array([1.0, 0, 0, 0, 0, turn]))
    found = [np.eye(4)]
    for _ in range(STEPS - 1):
        found.append(found[-1] @ step)
    return found


def exact(planes: Planes, camera: PinholeCamera = CAMERA) -> tuple[Tracks, Floats]:
    """Every point of the room tracked without an error through all frames; and ``lidar_from_world`` of these."""
    count = len(planes.points)
    landmark, frame = np.tile(np.arange(count), STEPS), np.repeat(np.arange(STEPS), count)
    inverse = np.stack([invert(pose) for pose in poses()])
    tracks = Tracks(landmark, frame, np.zeros((count * STEPS, 2)), planes.points)
    pixel = seen(planes.points, tracks, inverse, REFERENCE, camera.matrix)
    return replace(tracks, pixel=pixel), inverse


def test_the_extrinsic_is_found_from_tracks_and_planes() -> None:
    generator = np.random.default_rng(0)
    planes = room(generator)
    tracks, inverse = exact(planes)
    initial = miscalibration([0.8, -0.9, 0.7], [0.1, -0.08, 0.12]) @ REFERENCE
    rows, on = np.arange(len(planes.points)), np.ones(len(planes.points), bool)
    start = planes.points + generator.normal(0, 0.1, planes.points.shape)
    found = Problem(tracks, inverse, CAMERA, initial, KNOWN).adjusted_from(initial, start, planes, rows, on)
    left = pose_error(found.camera_from_lidar, REFERENCE)
    assert left.rotation_deg < 0.02 and left.translation_cm < 1.0
    assert np.median(found.reprojection) < 0.05
    assert np.linalg.eigvalsh(found.covariance).min() > 0


def test_without_planes_the_translation_stays_as_far_off_as_it_was_and_is_known_to_be() -> None:
    planes = room(np.random.default_rng(1))
    tracks, _ = exact(planes)
    straight = np.stack([invert(transform(np.eye(3), [1.0 * step, 0, 0])) for step in range(STEPS)])
    tracks = replace(tracks, pixel=seen(planes.points, tracks, straight, REFERENCE, CAMERA.matrix))
    initial = miscalibration([0, 0, 0], [0.1, 0, 0]) @ REFERENCE
    rows, on = np.arange(len(planes.points)), np.zeros(len(planes.points), bool)
    problem = Problem(tracks, straight, CAMERA, initial, KNOWN)
    found = problem.adjusted_from(initial, planes.points, planes, rows, on)
    assert pose_error(found.camera_from_lidar, REFERENCE).x_cm == pytest.approx(10, abs=3)
    assert np.sqrt(found.covariance[0, 0]) > 0.1


def test_the_focal_length_is_found_where_it_may_move() -> None:
    planes = room(np.random.default_rng(2))
    tracks, inverse = exact(planes)
    said = PinholeCamera(1200, 400, CAMERA.matrix * np.array([[1.01], [1.01], [1.0]]) * [1, 1, 1 / 1.01])
    rows, on = np.arange(len(planes.points)), np.ones(len(planes.points), bool)
    problem = Problem(tracks, inverse, said, REFERENCE, KNOWN, intrinsics=True)
    found = problem.adjusted_from(REFERENCE, planes.points, planes, rows, on)
    assert said.matrix[0, 0] == pytest.approx(707)
    assert found.camera.matrix[0, 0] == pytest.approx(700, abs=1.0)


def scan_of(planes: Planes, pose: Transform) -> np.ndarray[tuple[int, int], np.dtype[np.float32]]:
    points = transform_points(invert(pose), planes.points)
    return np.concatenate([points, np.ones((len(points), 1))], axis=1).astype(np.float32)


def test_the_motion_is_that_of_the_scans() -> None:
    world = room(np.random.default_rng(3), 20_000)
    first, found = longest_run([scan_of(world, pose) for pose in poses()])
    assert first == 0 and len(found) == STEPS
    off = pose_error(found[-1], poses()[-1])
    assert off.translation_cm < 3 and off.rotation_deg < 0.1
    metres, degrees = path(found)
    assert metres == pytest.approx(5, abs=0.1) and degrees == pytest.approx(np.degrees(0.3), abs=0.3)


def test_planes_have_the_normals_of_their_walls() -> None:
    world = room(np.random.default_rng(4), 40_000)
    found = planes_of([scan_of(world, np.eye(4))], [np.eye(4)])
    floor = found.points[:, 2] < -1.45
    inside = np.abs(found.points[:, 1]) < 5.0  # where no wall is near
    assert (np.abs(found.normals[floor & inside, 2]) > 0.99).mean() > 0.95
    rows, on = found.nearest(np.array([[15.0, 0, -1.4], [15, 0, 100]]), within=1.0)
    assert on.tolist() == [True, False] and abs(found.points[rows[0], 2] + 1.5) < 0.1


def test_a_drive_that_stands_still_is_refused() -> None:
    still = scan_of(room(np.random.default_rng(5), 20_000), np.eye(4))
    frames = [replace(boxes(), index=index, points=still) for index in range(4)]
    with pytest.raises(CalibrationError, match=r"needs a moving car: this one moves 0\.0 m"):
        PCBA(MiscalibrationRange(1, 0.1)).calibrate_drive(frames, frames[0].camera_from_lidar)
    with pytest.raises(CalibrationError, match="several frames of a moving car"):
        PCBA(MiscalibrationRange(1, 0.1)).calibrate(frames[0], frames[0].camera_from_lidar)


def test_a_synthetic_drive_is_solved_and_keeps_the_promises_of_a_method(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("calibnet.methods.pcba.method.MOST_LANDMARKS", 300)
    drive = SyntheticSequence(seed=9, length=6, rig=KITTI_LIKE)
    frames = [drive[position] for position in range(len(drive))]
    method = PCBA(MiscalibrationRange(1, 0.1))
    check_method(method, drive=frames)
    initial = miscalibration([0.3, -0.5, 0.9], [0.05, 0.05, -0.05]) @ frames[0].camera_from_lidar
    left = pose_error(method.calibrate_drive(frames, initial).camera_from_lidar, frames[0].camera_from_lidar)
    assert left.rotation_deg < 0.4 and left.translation_cm < 12
    with pytest.raises(CalibrationError, match=r"far outside the range ±0\.2°/0\.01 m"):
        PCBA(MiscalibrationRange(0.2, 0.01)).calibrate_drive(frames, initial)
