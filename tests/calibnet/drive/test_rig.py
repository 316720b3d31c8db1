"""Several cameras solved as one: normal equations in the rig's frame, and evidence of a camera as that of the rig."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from calibnet.alignment.evidence import InRig
from calibnet.cascade import Cascade, Stage
from calibnet.datasets.rig import RigCamera
from calibnet.drive.consensus import Consensus
from calibnet.drive.rig_pose import CameraConsensus, rig_correction
from calibnet.geometry import RANGES, invert, miscalibration, pose_error, rotation_from_vector, transform
from calibnet.geometry.prior import Prior, inverse
from calibnet.geometry.se3 import adjoint, pose_from_vector, pose_vector
from tests.support.scene import REFERENCE, make_frame
from tests.support.tiny import tiny_network

SIDE = transform(rotation_from_vector([0.1, 1.5, -0.2]), [0.4, -0.3, 0.9])
"""A camera that looks to the side, from the rig."""
RANGE = RANGES[3]
PRIOR = RANGE.information
POINTS = np.random.default_rng(2).uniform(-5, 5, (20, 3))
COMMON = np.diag([0.03**2] * 3 + [0.001**2] * 3)


def test_the_adjoint_is_the_motion_of_the_camera_by_one_of_the_rig():
    small = 1e-6 * np.array([1.0, -2.0, 3.0, 0.5, 1.5, -1.0])
    of_camera = SIDE @ pose_from_vector(small) @ invert(SIDE)
    assert_allclose(adjoint(SIDE) @ small, pose_vector(of_camera), atol=1e-11)


def saying(
    camera_from_rig: np.ndarray, rig: np.ndarray, truth: np.ndarray, sigma: np.ndarray, ahead: float = 0.0
) -> Consensus:
    """A camera whose only frame says where the truth is, as firmly as ``sigma [6]``, but for some metres ahead."""
    before = camera_from_rig @ rig
    consensus = Consensus(before, RANGE)
    wrong = transform(np.eye(3), [0.0, 0.0, ahead])
    consensus.add(wrong @ camera_from_rig @ truth @ invert(before), np.diag(sigma**-2.0) + PRIOR)
    return consensus


def say(cameras: list[RigCamera], agreed: list[Consensus], common: np.ndarray) -> list[CameraConsensus]:
    return [CameraConsensus.of(camera, consensus, common) for camera, consensus in zip(cameras, agreed, strict=True)]


def test_what_all_cameras_say_alike_is_the_rig_s_pose():
    truth = miscalibration([0.3, -0.4, 0.2], [0.03, -0.02, 0.01]) @ REFERENCE
    cameras = [RigCamera("front", [], np.eye(4)), RigCamera("side", [], SIDE)]
    firm = np.full(6, 1e-4)
    agreed = [saying(camera.camera_from_rig, REFERENCE, truth, firm) for camera in cameras]
    mean, covariance = rig_correction(say(cameras, agreed, 1e-10 * np.eye(6)), REFERENCE)
    found = pose_from_vector(mean) @ REFERENCE
    error = pose_error(found, truth)
    assert error.rotation_deg < 0.02 and error.translation_cm < 0.1
    assert (np.linalg.eigvalsh(covariance) > 0).all()


def test_one_camera_s_blind_axis_is_another_s_best():
    """Each camera cannot tell how far ahead it is; the axis of one is across for the other."""
    truth = miscalibration([0, 0, 0], [0.04, 0.0, 0.05]) @ REFERENCE
    blind_ahead = np.array([0.002, 0.002, 10.0, 1e-4, 1e-4, 1e-4])
    side = transform(rotation_from_vector([0.0, np.pi / 2, 0.0]), [0.0, 0.0, 0.0])
    cameras = [RigCamera("front", [], np.eye(4)), RigCamera("side", [], side)]
    agreed = [saying(camera.camera_from_rig, REFERENCE, truth, blind_ahead, 0.08) for camera in cameras]
    alone, _ = rig_correction(say(cameras[:1], agreed[:1], 1e-8 * np.eye(6)), REFERENCE)
    both, covariance = rig_correction(say(cameras, agreed, 1e-8 * np.eye(6)), REFERENCE)
    assert alone[2] == pytest.approx(0.13, abs=0.01)
    assert_allclose(both[:3], [0.04, 0.0, 0.05], atol=2e-3)
    assert np.sqrt(covariance[2, 2]) < 0.005


def test_more_cameras_are_surer():
    cameras = [
        RigCamera(str(number), [], transform(rotation_from_vector([0, number, 0]), [0, 0, 0])) for number in range(4)
    ]
    agreed = [saying(camera.camera_from_rig, REFERENCE, REFERENCE, np.full(6, 0.01)) for camera in cameras]
    one, four = (rig_correction(say(cameras[:n], agreed[:n], COMMON), REFERENCE)[1] for n in (1, 4))
    assert np.trace(four) == pytest.approx(np.trace(one) / 4, rel=0.01)


def test_what_is_known_of_the_rig_counts():
    cameras = [RigCamera("side", [], SIDE)]
    truth = miscalibration([0.3, -0.4, 0.2], [0.03, -0.02, 0.01]) @ REFERENCE
    agreed = [saying(SIDE, REFERENCE, truth, np.full(6, 1e-3))]
    mean, _ = rig_correction(say(cameras, agreed, COMMON), REFERENCE, Prior.of("xyz").about(REFERENCE))
    assert_allclose(mean[:3], 0.0, atol=1e-6)
    assert np.abs(mean[3:]).max() > 1e-3


def two_that_differ(off: np.ndarray) -> list[CameraConsensus]:
    """The first camera says that the rig is where it was, the second that it itself is off by so much."""
    cameras = [RigCamera("front", [], np.eye(4)), RigCamera("side", [], SIDE)]
    firm = np.full(6, 0.01)
    agreed = [saying(camera.camera_from_rig, REFERENCE, REFERENCE, firm) for camera in cameras]
    told = say(cameras, agreed, 1e-12 * np.eye(6))
    return [told[0], replace(told[1], camera_from_lidar=pose_from_vector(off) @ told[1].camera_from_lidar)]


def test_within_a_tolerance_cameras_end_as_all_that_is_known_makes_most_likely():
    """Against the six poses and deviations solved by one dense system, with covariances."""
    off = 1e-3 * np.array([4.0, -2.0, 3.0, 1.0, 2.0, -1.0])
    told = two_that_differ(off)
    tolerance = np.diag([0.02**2] * 3 + [0.005**2] * 3)
    mean, covariance = rig_correction(told, REFERENCE, tolerance=tolerance)
    rig = pose_from_vector(mean) @ REFERENCE
    # unknown: motion of the rig, and of each camera in its own frame; measured: the cameras; expected: on the rig
    normal, right = np.zeros((18, 18)), np.zeros(18)
    for position, one in enumerate(told):
        own, to_camera = slice(6 + 6 * position, 12 + 6 * position), adjoint(one.camera.camera_from_rig)
        measured = pose_vector(one.camera_from_lidar @ invert(one.camera.camera_from_rig @ REFERENCE))
        firm, firm_place = inverse(one.covariance), inverse(tolerance)
        normal[own, own] += firm + firm_place
        right[own] += firm @ measured
        normal[:6, :6] += to_camera.T @ firm_place @ to_camera
        normal[:6, own] -= to_camera.T @ firm_place
        normal[own, :6] -= firm_place @ to_camera
    solution, spread = np.linalg.solve(normal, right), np.linalg.inv(normal)
    assert_allclose(mean, solution[:6], atol=2e-5)
    assert_allclose(covariance, spread[:6, :6], rtol=1e-6, atol=1e-12)
    for position, one in enumerate(told):
        own = slice(6 + 6 * position, 12 + 6 * position)
        there = one.placed(rig, tolerance) @ rig
        found = pose_vector(there @ invert(one.camera.camera_from_rig @ REFERENCE))
        assert_allclose(found, solution[own], atol=2e-5)
        assert_allclose(one.spread(covariance, tolerance), spread[own, own], rtol=1e-6, atol=1e-12)


def test_no_tolerance_is_the_rigid_rig_and_an_endless_one_each_camera_on_its_own():
    off = 1e-2 * np.array([4.0, -2.0, 3.0, 1.0, 2.0, -1.0])
    told = two_that_differ(off)
    rigid, of_rig = rig_correction(told, REFERENCE)
    none, _ = rig_correction(told, REFERENCE, tolerance=1e-14 * np.eye(6))
    assert_allclose(none, rigid, atol=1e-9)
    rig = pose_from_vector(rigid) @ REFERENCE
    assert_allclose(told[1].placed(rig, 1e-14 * np.eye(6)), SIDE, atol=1e-9)
    assert_allclose(told[1].spread(of_rig, 1e-14 * np.eye(6)), told[1].spread(of_rig, None), atol=1e-9)
    assert_allclose(told[1].placed(rig, 1e6 * np.eye(6)) @ rig, told[1].camera_from_lidar, atol=1e-6)
    assert_allclose(told[1].spread(of_rig, 1e6 * np.eye(6)), told[1].covariance, atol=1e-7)


def springs(correction: np.ndarray) -> tuple[float, np.ndarray]:
    """Evidence as of edges, but smooth: points of the camera frame that are pulled along and towards its centre."""
    points = POINTS @ correction[:3, :3].T + correction[:3, 3]
    forces = points + np.array([1.0, -2.0, 0.5])
    value = float((0.5 * points**2 + points * [1.0, -2.0, 0.5]).sum())
    return value, np.concatenate([forces.sum(0), np.cross(points - correction[:3, 3], forces).sum(0)])


def test_evidence_of_a_camera_is_evidence_of_the_rig():
    """Its value is that of the camera's correction, and its gradient that of a motion of the rig."""
    evidence = InRig(springs, SIDE)
    correction = pose_from_vector(np.array([0.2, -0.1, 0.15, 0.03, -0.02, 0.04]))
    value, gradient = evidence(correction)
    assert value == pytest.approx(springs(SIDE @ correction @ invert(SIDE))[0])
    step = 1e-5
    for axis in range(6):
        moved = []
        for sign in (1, -1):
            motion = pose_from_vector(sign * step * np.eye(6)[axis])
            after = correction.copy()
            after[:3, :3] = motion[:3, :3] @ correction[:3, :3]
            after[:3, 3] = correction[:3, 3] + motion[:3, 3]
            moved.append(evidence(after)[0])
        assert gradient[axis] == pytest.approx((moved[0] - moved[1]) / (2 * step), rel=1e-5, abs=1e-5), axis


def test_a_rig_is_solved_with_all_its_cameras_and_told_about_bad_frames():
    stages = [Stage(number, RANGES[number - 1], tiny_network(seed=number, stage=number)) for number in (4, 5)]
    frames = [make_frame(3), make_frame(1)]
    blind = [make_frame(2)]
    object.__setattr__(blind[0], "points", blind[0].points[:0])
    cameras = [
        RigCamera("a", frames, np.eye(4)),
        RigCamera("b", frames[:1], np.eye(4)),
        RigCamera("c", blind, np.eye(4)),
    ]
    told: list[tuple[int, int]] = []
    estimate = Cascade(stages).calibrate_rig(cameras, REFERENCE, lambda *numbers: told.append(numbers))
    assert estimate.frames == 3
    assert len(estimate.skipped) == 1, "a camera none of whose frames can be used is left out"
    assert told[-2][0] < told[-1][0] == told[-1][1] == 4 * 4 + 4, "the end is told as well"
    assert (np.linalg.eigvalsh(estimate.covariance) > 0).all()
    assert estimate.verdict is not None and estimate.networks is not None
    assert inverse(estimate.covariance).shape == (6, 6)
    assert len(estimate.looks) == 3
    a, b, c = estimate.cameras
    assert [one.frames for one in (a, b, c)] == [2, 1, 0]
    for one in (a, b, c):
        assert_allclose(one.camera_from_lidar, estimate.camera_from_lidar, atol=1e-9, err_msg="they are in one place")
        assert_allclose(one.covariance, estimate.covariance, rtol=1e-6, atol=1e-15)
    assert a.alone is not None and c.alone is None and a.match_error_px > 0
    loose = Cascade(stages).calibrate_rig(cameras, REFERENCE, tolerance=1e4 * np.eye(6))
    apart = pose_error(loose.cameras[0].camera_from_lidar, loose.cameras[1].camera_from_lidar)
    assert apart.translation_cm > 0.1, "each camera may go where it wants"
    assert_allclose(loose.cameras[0].alone, 0.0, atol=1e-4)
