"""Cameras at any roll: the image is turned upright, and what the stages find is turned back."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from calibnet.cascade import Cascade, Stage
from calibnet.cascade.prepared import PreparedFrames, prepared
from calibnet.cascade.upright import FILLED, TOLERATED_DEG, Upright, roll_of
from calibnet.datasets.frame import Frame
from calibnet.geometry import (
    RANGES,
    PinholeCamera,
    miscalibration,
    pose_error,
    project,
    rotation_from_vector,
    transform,
)
from calibnet.geometry.prior import Prior
from calibnet.geometry.visibility import as_one_scan
from calibnet.trace import CascadeTrace
from tests.support.pillars import scan
from tests.support.scene import REFERENCE, make_frame
from tests.support.tiny import tiny_network

MATRIX = np.array([[150.0, 0.0, 131.0], [0.0, 155.0, 44.0], [0.0, 0.0, 1.0]])
DELTA = miscalibration([2.0, -1.0, 3.0], [0.2, -0.1, 0.3])

NARROW = RANGES[2]
"""Of most guesses: 5 degrees."""


def roll(degrees: float) -> np.ndarray:
    return transform(rotation_from_vector([0.0, 0.0, np.radians(degrees)]), np.zeros(3))


def dots(degrees: float) -> Frame:
    """A camera at a roll, and an image with a dot where each of its points is."""
    extrinsic = roll(degrees) @ REFERENCE
    camera = PinholeCamera(256, 96, MATRIX)
    upright = np.array([[-1.6, -0.2, 9.0], [0.4, 0.6, 5.0], [2.5, -0.7, 12.0], [0.1, 0.1, 30.0]])
    points = ((upright - REFERENCE[:3, 3]) @ REFERENCE[:3, :3]).astype(np.float32)
    scan = np.concatenate([points, np.ones((4, 1), np.float32)], axis=1)
    v, u = np.mgrid[:96, :256]
    picture = np.full((96, 256), 10.0)
    for x, y in project(scan, extrinsic, camera).pixels:
        picture += 240 * np.exp(-((u - x) ** 2 + (v - y) ** 2) / (2 * 1.2**2))
    image = np.repeat(picture.clip(0, 255).astype(np.uint8)[..., None], 3, axis=2)
    return Frame(0, 0.0, image, scan, camera, extrinsic)


@pytest.mark.parametrize("degrees", [-170, -95, -30, 0, 12, 89, 140, 179])
def test_the_roll_of_a_camera_is_read_off_its_extrinsic(degrees):
    pitched = transform(rotation_from_vector([0.5, 0.0, 0.0]), np.zeros(3)) @ REFERENCE  # looks 29 degrees up
    assert np.degrees(roll_of(roll(degrees) @ pitched)) == pytest.approx(degrees)


def test_a_camera_that_looks_up_or_down_has_no_roll():
    for pitch in (-80, 80):
        turned = transform(rotation_from_vector([np.radians(pitch), 0.0, 0.0]), np.zeros(3)) @ REFERENCE
        assert not Upright.of(roll(40) @ turned, NARROW)


@pytest.mark.parametrize(
    ("degrees", "quarters", "rest"),
    [(0, 0, 0), (7.9, 0, 0), (-7.9, 0, 0), (8.1, 0, -8.1), (30, 0, -30), (90, -1, 0), (97, -1, 0), (-90, 1, 0),
     (180, -2, 0), (120, -1, -30), (-50, 1, -40)],
)  # fmt: skip
def test_a_camera_is_turned_by_quarters_and_by_the_rest_where_that_is_not_small(degrees, quarters, rest):
    upright = Upright.of(roll(degrees) @ REFERENCE, NARROW)
    assert upright.quarters % 4 == quarters % 4
    assert np.degrees(upright.rest) == pytest.approx(rest)
    left = roll_of(upright.extrinsic(roll(degrees) @ REFERENCE))
    assert abs(left) <= np.radians(TOLERATED_DEG) + 1e-9
    assert left == pytest.approx(0.0) or not rest


@pytest.mark.parametrize("degrees", [10, 33, 90, -90, 135, 180, -160])
def test_points_stay_on_their_dots(degrees):
    """The turned camera with the turned extrinsic projects every point onto the dot that was drawn for it."""
    frame = dots(degrees)
    upright = Upright.of(frame.camera_from_lidar, NARROW).frame(frame)
    seen = project(upright.points, upright.camera_from_lidar, upright.camera)
    before = project(frame.points, frame.camera_from_lidar, frame.camera)
    assert set(seen.index) <= set(before.index) and len(seen.index) >= 2
    grey = cv2.GaussianBlur(upright.image[..., 0], (0, 0), 0.5)
    v, u = np.mgrid[: upright.camera.height, : upright.camera.width]
    for x, y in seen.pixels:
        near = ((u - x) ** 2 + (v - y) ** 2 < 5**2) * (grey.astype(float) - 10).clip(0)
        assert [(near * u).sum() / near.sum(), (near * v).sum() / near.sum()] == pytest.approx([x, y], abs=0.3)


@pytest.mark.parametrize(("degrees", "clockwise"), [(90, -1), (-90, 1), (180, 2)])
def test_quarter_turns_keep_every_pixel(degrees, clockwise):
    frame = dots(degrees)
    upright = Upright.of(frame.camera_from_lidar, NARROW).frame(frame)
    np.testing.assert_array_equal(upright.image, np.rot90(frame.image, -clockwise))
    focal, center = {-1: ((155, 150), (44, 124)), 1: ((155, 150), (51, 131)), 2: ((150, 155), (124, 51))}[clockwise]
    assert upright.camera.focal == focal and upright.camera.center == center
    assert (upright.camera.width, upright.camera.height) == upright.image.shape[1::-1]


def test_a_turned_image_is_cut_to_where_it_mostly_is():
    image = np.full((300, 400, 3), 200, np.uint8)
    matrix = np.array([[300.0, 0, 199.5], [0, 300.0, 149.5], [0, 0, 1.0]])
    frame = Frame(0, 0.0, image, np.zeros((1, 4), np.float32), PinholeCamera(400, 300, matrix), roll(30) @ REFERENCE)
    upright = Upright.of(frame.camera_from_lidar, NARROW).frame(frame)
    assert (upright.image == 200).all(), "beyond its border the image goes on"
    # 400x300 turned by 30 degrees is 496x460; rows of a third of the fullest begin where its corners are as wide
    widest = 400 / np.cos(np.radians(30))
    wide = 1 / np.tan(np.radians(30)) + np.tan(np.radians(30))  # a corner widens by so much a row
    rows = 400 * np.sin(np.radians(30)) + 300 * np.cos(np.radians(30)) - 2 * FILLED * widest / wide
    assert upright.camera.height == pytest.approx(rows, abs=4)
    assert upright.camera.center[1] == pytest.approx((upright.camera.height - 1) / 2, abs=2)


def test_black_borders_are_no_image():
    """An image that somebody has turned before has them."""
    frame = dots(0)
    canvas = np.zeros((256, 256, 3), np.uint8)
    canvas[80:176] = frame.image
    matrix = MATRIX + np.array([[0, 0, 0], [0, 0, 80.0], [0, 0, 0]])
    camera = PinholeCamera(256, 256, matrix)
    rotation = rotation_from_vector([0.0, 0.0, np.radians(30)])
    image = cv2.warpPerspective(canvas, matrix @ rotation @ np.linalg.inv(matrix), (256, 256))
    tilted = replace(frame, image=image, camera=camera, camera_from_lidar=roll(30) @ REFERENCE)
    upright = Upright.of(tilted.camera_from_lidar, NARROW).frame(tilted)
    assert upright.camera.height == pytest.approx(96, abs=6)
    assert upright.camera.width == pytest.approx(256, abs=20)


def test_a_roll_within_the_range_that_is_searched_may_be_the_guess_s_error():
    turns = [Upright.of(roll(degrees) @ REFERENCE, RANGES[0]).rest for degrees in (12.0, 22.9, 23.1)]
    np.testing.assert_allclose(np.degrees(turns), [0.0, 0.0, -23.1])
    assert Upright.of(roll(70) @ REFERENCE, RANGES[0]) == Upright(-1, 0.0), "20 degrees short of a quarter"


@pytest.mark.parametrize("degrees", [0.0, 5.0, -7.9])
def test_an_upright_camera_is_left_as_it_is(degrees):
    frame = make_frame(3)
    initial = roll(degrees) @ REFERENCE
    upright = Upright.of(initial, NARROW)
    assert upright.frame(frame) is frame and upright.extrinsic(initial) is initial
    trace = CascadeTrace(initial, ())
    assert upright.undo(trace, initial) is trace


def cascade(prior: Prior | None = None) -> Cascade:
    stages = [Stage(number, RANGES[number - 1], tiny_network(seed=number, stage=number)) for number in (4, 5)]
    return Cascade(stages, prior=prior)


def rolled(frame: Frame, quarters: int) -> Frame:
    """The frame as a camera has it that was mounted turned by so many quarters."""
    turned = Upright(quarters).frame(frame)
    return replace(turned, camera_from_lidar=roll(90 * quarters) @ frame.camera_from_lidar)


@pytest.mark.parametrize("quarters", [1, 2, 3])
def test_a_camera_on_its_head_or_side_is_calibrated_as_one_that_stands(quarters):
    frame = make_frame(3)
    standing = cascade().calibrate(frame, DELTA @ REFERENCE, detail=True)
    initial = roll(90 * quarters) @ DELTA @ REFERENCE
    lying = cascade().calibrate(rolled(frame, quarters), initial, detail=True)
    assert np.array_equal(lying.initial, initial) and np.array_equal(lying.stages[0].before, initial)
    assert lying.rejected == standing.rejected
    turn = roll(90 * quarters)
    for one, other in zip(standing.stages, lying.stages, strict=True):
        np.testing.assert_allclose(other.after, turn @ one.after, atol=1e-5)
        np.testing.assert_allclose(other.after, other.correction @ other.before, atol=1e-9)
        assert other.match_error_px == pytest.approx(one.match_error_px, rel=1e-3)
        assert other.camera.width == one.camera.width and one.upright is None
        np.testing.assert_allclose(other.upright, turn[:3, :3].T, atol=1e-12)
        assert one.information is not None and other.information is not None
        axes = np.kron(np.eye(2), turn[:3, :3])
        np.testing.assert_allclose(other.information, axes @ one.information @ axes.T, rtol=1e-3, atol=1.0)


@pytest.mark.parametrize("quarters", [0, 1])
def test_a_frame_is_explained_with_what_is_known_of_it_as_it_is_calibrated(quarters):
    frame, initial = make_frame(3), roll(90 * quarters) @ DELTA @ REFERENCE
    frame = rolled(frame, quarters) if quarters else frame
    known = cascade(Prior.of("x", translation_m=0.02))
    calibrated, explained = known.calibrate(frame, initial).verdict, known.explain(frame, initial)
    assert calibrated.covariance is not None and explained.covariance is not None
    np.testing.assert_allclose(explained.camera_from_lidar, calibrated.camera_from_lidar, atol=1e-12)
    np.testing.assert_allclose(explained.covariance, calibrated.covariance, rtol=1e-9, atol=1e-15)
    held = explained.camera_from_lidar @ np.linalg.inv(initial)
    assert abs(held[0, 3]) < 1e-3 < np.sqrt(explained.covariance[1, 1]) < 0.03, "x of the camera as it is mounted"


def test_a_drive_of_a_camera_on_its_head_is_solved_as_one_that_stands():
    frames = [make_frame(3), make_frame(4)]
    standing = cascade().calibrate_drive(frames, DELTA @ REFERENCE)
    lying = cascade().calibrate_drive([rolled(frame, 2) for frame in frames], roll(180) @ DELTA @ REFERENCE)
    turn = roll(180)
    assert pose_error(lying.camera_from_lidar, turn @ standing.camera_from_lidar).rotation_deg < 1e-2
    assert pose_error(lying.camera_from_lidar, turn @ standing.camera_from_lidar).translation_cm < 0.1
    axes = np.kron(np.eye(2), turn[:3, :3])
    np.testing.assert_allclose(lying.covariance, axes @ standing.covariance @ axes.T, rtol=0.02, atol=1e-9)
    assert [frame for frame, _ in lying.history] == [frame for frame, _ in standing.history]
    assert np.array_equal(lying.history[-1][1].camera_from_lidar, lying.camera_from_lidar)
    assert lying.networks is not None and standing.networks is not None
    assert pose_error(lying.networks.camera_from_lidar, turn @ standing.networks.camera_from_lidar).rotation_deg < 1e-2


def test_frames_of_a_drive_are_prepared_as_they_are_read():
    frames = [make_frame(1), make_frame(2)]
    turned = PreparedFrames(frames, Upright(1))
    assert len(turned) == 2
    assert turned[1].image.shape == (*frames[1].image.shape[1::-1], 3)
    assert PreparedFrames(frames, Upright())[1] is frames[1]


def test_a_cloud_of_several_scans_is_prepared_as_one():
    one, several = scan(0.0, 0.0), np.concatenate([scan(ahead, 0.5 * ahead) for ahead in (0.0, -2.0, 2.0, 4.0)])
    frame = replace(make_frame(1), points=one)
    assert prepared(frame, Upright()) is frame
    once = prepared(replace(frame, points=several), Upright())
    np.testing.assert_array_equal(once.points, as_one_scan(several))
    assert len(once.points) < 0.5 * len(several)
    assert [remark.name for remark in once.remarks] == ["accumulated"], "a suspect if the result is doubted"
    again = prepared(replace(once, points=several), Upright())
    assert again.remarks == once.remarks, "said once, whoever read the frame has said it already"
