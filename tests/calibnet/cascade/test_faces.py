"""A wide lens is seen through its faces, and what they say is one correction of the real camera."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from calibnet.alignment import gather
from calibnet.cascade import Cascade, Stage
from calibnet.cascade.faces import join_looks
from calibnet.errors import CalibrationError
from calibnet.geometry import RANGES, miscalibration, pose_error, project, rotation_from_vector, transform
from calibnet.geometry.se3 import pose_from_vector
from calibnet.judging.covariance import CovarianceModel
from calibnet.trace import StageTrace
from tests.support.scene import REFERENCE
from tests.support.tiny import tiny_network
from tests.support.wide import MOUNT, make_wide, turned

SIDE = rotation_from_vector([0.0, np.pi / 2, 0.0])
"""A face that looks at right angles to the camera."""


def cascade() -> Cascade:
    return Cascade([Stage(number, RANGES[number - 1], tiny_network(seed=number, stage=number)) for number in (3, 5)])


def test_faces_see_what_the_lens_sees():
    """A point's dot lies where the face projects the point, for each face."""
    frame = make_wide()
    assert len(frame.faces) == 3
    for face in frame.faces:
        seen = frame.through(face)
        pixels = np.round(project(seen.points, seen.camera_from_lidar, seen.camera).pixels).astype(int)
        inside = (pixels > 1).all(1) & (pixels < [seen.camera.width - 2, seen.camera.height - 2]).all(1)
        u, v = pixels[inside].T
        brightness = seen.image.max(axis=2)
        lit = np.max([brightness[v + dv, u + du] for dv in (-1, 0, 1) for du in (-1, 0, 1)], axis=0)
        assert (lit > 95).mean() > 0.9
        assert (brightness > 95).mean() < 0.35, "most of it is no dot"


def saying(face: np.ndarray, truth: np.ndarray, sigma: np.ndarray, error_px: float = 2.0) -> StageTrace:
    """A look of the finest stage through a face, which says where the truth is, so firmly along the face's axes."""
    turn = transform(face, np.zeros(3))
    before, after = turn @ REFERENCE, turn @ truth
    range_ = RANGES[4]
    blind = pose_from_vector(np.where(sigma > 1, [0.0, 0.0, 0.3, 0.0, 0.0, 0.0], 0.0))
    correction = blind @ after @ np.linalg.inv(before)
    look = StageTrace(
        5, range_, None, before, correction @ before, correction, {"network": 1.0},
        np.diag(sigma**-2.0) + range_.information, match_error_px=error_px,
    )  # fmt: skip
    return look.rotated(face.T)


MODEL = CovarianceModel()
AHEAD_UNKNOWN = np.array([0.001, 0.001, 100.0, 1e-4, 1e-4, 1e-4])


def test_one_face_s_blind_axis_is_another_s_best():
    truth = miscalibration([0.05, -0.02, 0.03], [0.02, 0.01, 0.04]) @ REFERENCE
    ahead, side = saying(np.eye(3), truth, AHEAD_UNKNOWN), saying(SIDE, truth, AHEAD_UNKNOWN)
    alone = pose_error(ahead.after, truth).translation_cm
    assert alone == pytest.approx(30, abs=1)
    both = join_looks([ahead, side], 5.0, MODEL)
    error = pose_error(both.after, truth)
    assert error.translation_cm < 0.6 * alone, "each also errs alike in all its matches, which nothing else tells"
    assert error.rotation_deg < 0.01
    assert_allclose(both.after, both.correction @ both.before)
    assert both.milliseconds == {"network": 2.0}
    expected = ahead.information + side.information - RANGES[4].information
    assert_allclose(both.information, expected, rtol=1e-9, err_msg="the prior is counted once")


def test_a_face_that_shows_something_else_is_left_out():
    truth = miscalibration([0.05, 0, 0], [0.02, 0, 0]) @ REFERENCE
    good = saying(SIDE, truth, np.full(6, 0.001))
    lost = saying(np.eye(3), miscalibration([3, 0, 0], [0.5, 0, 0]) @ REFERENCE, np.full(6, 0.001), error_px=9.0)
    assert join_looks([lost, good], 5.0, MODEL) is good
    assert join_looks([lost], 5.0, MODEL) is lost, "where none fits, that is what is told"
    torn = join_looks([lost, good], np.inf, MODEL)
    assert pose_error(torn.after, truth).rotation_deg < pose_error(lost.after, truth).rotation_deg / 3


def test_a_frame_of_a_wide_lens_is_calibrated_through_all_its_faces():
    frame = make_wide()
    trace = cascade().calibrate(frame, MOUNT, detail=True)
    middle = cascade().calibrate(replace(frame, faces=()), MOUNT)
    assert pose_error(trace.arrived, middle.arrived).rotation_deg > 1e-3, "the middle alone says something else"
    for stage in trace.stages:
        assert_allclose(stage.after, stage.correction @ stage.before, atol=1e-9)
        assert_allclose(stage.upright, frame.faces[0].face_from_camera, atol=1e-9)
        assert stage.camera.width / stage.camera.height == pytest.approx(
            frame.faces[0].camera.width / frame.faces[0].camera.height, rel=0.3
        )
        assert stage.detail is not None and (np.linalg.eigvalsh(stage.information) > 0).all()
    assert trace.verdict is not None
    assert_allclose(trace.verdict.camera_from_lidar, trace.arrived)


def test_a_fisheye_on_its_head_ends_where_the_upright_one_does():
    """Its faces show the same, so that the same correction is found, in axes that are turned by 180 degrees."""
    upright, head = make_wide(), make_wide(on_its_head=True)
    for one, other in zip(upright.faces, head.faces, strict=True):
        assert np.abs(one.image.astype(int) - other.image).max() <= 4
    delta = miscalibration([1.0, -0.5, 0.7], [0.1, -0.05, 0.1])
    start = delta @ MOUNT
    found = cascade().calibrate(upright, start)
    turn = turned(180.0)
    again = cascade().calibrate(head, turn @ start)
    assert_allclose(again.initial, turn @ start)
    error = pose_error(turn.T @ again.arrived, found.arrived)
    moved = pose_error(found.arrived, start)
    assert error.rotation_deg < moved.rotation_deg / 8, "what is left is rounding of pixels, which random weights feel"
    assert error.translation_cm < moved.translation_cm / 8


def test_a_drive_is_solved_through_all_faces():
    frames = [make_wide(seed=seed) for seed in range(2)]
    estimate = cascade().calibrate_drive(frames, MOUNT)
    assert estimate.frames == 2 and (np.linalg.eigvalsh(estimate.covariance) > 0).all()
    middle = cascade().calibrate_drive([replace(frame, faces=()) for frame in frames], MOUNT)
    assert pose_error(estimate.camera_from_lidar, middle.camera_from_lidar).rotation_deg > 1e-3


def test_no_face_shows_the_scan():
    frame = replace(make_wide(), points=make_wide().points[:3])
    with pytest.raises(CalibrationError, match="Hardly any of the 3 LiDAR points"):
        cascade().calibrate(frame, MOUNT)


def test_edges_of_all_faces_are_evidence_of_the_camera_as_one_image():
    """Its value is the mean of what each face says of the correction in its own axes."""
    frame = make_wide()
    correction = pose_from_vector(np.array([0.02, -0.01, 0.015, 0.003, -0.002, 0.004]))
    values = []
    for face in frame.faces:
        turn = transform(face.face_from_camera, np.zeros(3))
        values.append(gather(frame.through(face), turn @ MOUNT)(turn @ correction @ turn.T)[0])
    assert len(set(values)) == 3
    value, gradient = gather(frame, MOUNT)(correction)
    assert value == pytest.approx(np.mean(values))
    assert gradient.shape == (6,) and np.abs(gradient).min() > 0


def test_a_change_of_a_frame_is_one_of_all_its_faces():
    frame = make_wide()
    grey = frame.changed(lambda seen: replace(seen, image=np.full_like(seen.image, 128)))
    assert all((face.image == 128).all() for face in grey.faces) and (grey.image == 128).all()
    assert [face.camera for face in grey.faces] == [face.camera for face in frame.faces]
