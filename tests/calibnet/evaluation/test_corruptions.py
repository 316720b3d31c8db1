from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from calibnet.datasets.frame import Frame
from calibnet.datasets.synthetic import KITTI_LIKE, SyntheticSequence
from calibnet.evaluation import faults
from calibnet.evaluation.corruptions import Corruption, corruptions
from calibnet.geometry import PinholeCamera, project, transform
from calibnet.verdict import CAUSES
from tests.support.boxes import boxes
from tests.support.drive import Drive

FRAME = boxes()


def brightest(image: np.ndarray) -> tuple[float, float]:
    """Where a single bright spot lies, pixels."""
    v, u = np.nonzero(image[..., 0] > image.max() / 2)
    return float(u.mean()), float(v.mean())


def spot(u: int, v: int) -> np.ndarray:
    image = np.zeros((320, 1024, 3), np.uint8)
    image[v - 3 : v + 4, u - 3 : u + 4] = 255
    return image


def seen_at(frame: Frame, point: tuple[float, float, float]) -> tuple[float, float]:
    """Pixel at which the frame's truth sees a point of the LiDAR frame."""
    u, v = project(np.array([[*point, 0.0]], np.float32), frame.camera_from_lidar, frame.camera).pixels[0]
    return float(u), float(v)


def test_a_rolled_image_s_truth_is_rolled_with_it() -> None:
    # 10 m ahead, 2 m to the left: at u = 511.5 - 116 = 395.5, v = 159.5
    frame = replace(FRAME, image=spot(395, 159))
    assert seen_at(frame, (10, 2, 0)) == pytest.approx((395.5, 159.5), abs=0.01)
    rolled = faults.rolled(20)(frame)
    assert brightest(rolled.image) == pytest.approx(seen_at(rolled, (10, 2, 0)), abs=1.0)
    assert seen_at(rolled, (10, 2, 0))[1] < 159.5 - 35  # clockwise: what was left is up


def test_a_shifted_image_keeps_its_truth() -> None:
    shifted = faults.shifted(60, -20)(replace(FRAME, image=spot(400, 100)))
    scale = 1024 / 1242
    assert brightest(shifted.image) == pytest.approx((400 + 60 * scale, 100 - 20 * scale), abs=0.6)
    assert shifted.camera_from_lidar is FRAME.camera_from_lidar and shifted.camera is FRAME.camera


@pytest.mark.parametrize("k1", [-0.2, 0.1])
def test_a_distorted_image_shows_a_point_where_opencv_s_lens_does(k1: float) -> None:
    frame = faults.distorted(k1)(replace(FRAME, image=spot(711, 219)))
    ray = np.array([[(711 - 511.5) / 580, (219 - 159.5) / 580, 1.0]])
    place, _ = cv2.projectPoints(ray, np.zeros(3), np.zeros(3), frame.camera.matrix, np.array([k1, 0.0, 0.0, 0.0]))
    assert brightest(frame.image) == pytest.approx(place.ravel(), abs=0.7)
    assert frame.image.shape[:2] == (frame.camera.height, frame.camera.width)


def test_an_equidistant_image_shows_a_point_where_opencv_s_fisheye_does() -> None:
    frame = faults.equidistant(replace(FRAME, image=spot(711, 219)))
    ray = np.array([[[(711 - 511.5) / 580, (219 - 159.5) / 580, 1.0]]])
    place, _ = cv2.fisheye.projectPoints(ray, np.zeros(3), np.zeros(3), frame.camera.matrix, np.zeros(4))
    assert brightest(frame.image) == pytest.approx(place.ravel(), abs=0.7)
    white = faults.equidistant(replace(FRAME, image=np.full((320, 1024, 3), 255, np.uint8)))
    assert (white.image > 0).all()  # cut to what the lens fills


def test_the_matrix_of_another_size_and_a_wrong_lens_are_what_is_said_not_what_is() -> None:
    assert faults.matrix_of_size(0.5)(FRAME).camera.center == pytest.approx((255.5, 79.5))
    assert faults.focal(1.05)(FRAME).camera.focal == pytest.approx((609.0, 609.0))
    moved = faults.principal(60, 0)(FRAME).camera
    assert moved.center == pytest.approx((511.5 + 60 * 1024 / 1242, 159.5)) and moved.focal == (580.0, 580.0)


def test_bytes_of_an_image_with_more_bits() -> None:
    image = np.arange(256, dtype=np.uint8).reshape(16, 16, 1).repeat(3, axis=2)
    frame = replace(FRAME, image=image)
    assert faults.high_byte(12)(frame).image.max() == 15
    low = faults.low_byte(12)(frame).image
    assert (low // 16 == image % 16).all()  # 12 bits are 16 times as bright, and go round after 16 steps


def test_an_over_exposed_image_is_white_where_it_was_bright() -> None:
    image = np.full((4, 4, 3), 30, np.uint8)
    image[0] = 100
    exposed = faults.exposed(4)(replace(FRAME, image=image)).image
    assert (exposed[0] == 255).all() and (exposed[1:] == 120).all()


def test_scans_in_other_units_axes_and_hands() -> None:
    points = np.array([[10.0, 2.0, -1.0, 0.5]], np.float32)
    frame = replace(FRAME, points=points)
    assert faults.scaled_scan(1000.0)(frame).points[0] == pytest.approx([10000, 2000, -1000, 0.5])
    camera_axes = faults.AXIS_CONVENTIONS["x right, y down, z forward"]
    assert faults.turned(camera_axes)(frame).points[0] == pytest.approx([-2, 1, 10, 0.5])
    assert faults.turned(faults.AXIS_CONVENTIONS["x right, y forward, z up"])(frame).points[0] == pytest.approx(
        [-2, 10, -1, 0.5]
    )
    assert faults.flipped(1)(frame).points[0] == pytest.approx([10, -2, -1, 0.5])
    assert all(np.linalg.det(axes) == pytest.approx(1.0) for axes in faults.AXIS_CONVENTIONS.values())


def test_a_thinned_scan_keeps_one_band_of_so_many() -> None:
    elevation = np.radians(np.arange(-20.0, 0.0, 0.01))
    points = np.column_stack([np.cos(elevation), 0 * elevation, np.sin(elevation), 0 * elevation]) * 10
    left = faults.thinned(4)(replace(FRAME, points=points.astype(np.float32))).points
    assert len(left) / len(points) == pytest.approx(0.25, abs=0.01)


def test_scans_put_together_lie_on_each_other_where_the_world_stands_still() -> None:
    rig = replace(KITTI_LIKE, camera=KITTI_LIKE.camera.resized(310, 94))
    drive = SyntheticSequence(seed=4, length=3, rig=rig)
    single, three = drive[1], faults.accumulated(drive, 1, 3)(drive[1])
    assert len(three.points) == sum(len(drive[position].points) for position in range(3))
    here, there = drive[1].points[:, :3], drive[0].points[:, :3]
    forward = np.linalg.inv(drive.world_from_vehicle(0)) @ drive.world_from_vehicle(1)
    moved = three.points[: len(there), :3]
    assert (there - moved).mean(axis=0)[0] == pytest.approx(forward[0, 3], abs=0.02)  # the car drives on
    assert np.array_equal(three.points[len(there) : len(there) + len(here), :3], here)
    assert np.array_equal(three.camera_from_lidar, single.camera_from_lidar)


def test_every_fault_runs_and_names_a_known_cause() -> None:
    rig = replace(KITTI_LIKE, camera=KITTI_LIKE.camera.resized(310, 94))
    drive = SyntheticSequence(seed=4, length=3, rig=rig)
    all_faults = list(corruptions(drive, 1, [FRAME]))
    names = {fault.name for fault in all_faults}
    assert {"late-scan", "accumulated", "mirrored", "rolled", "focal-length", "equidistant", "units"} <= names
    assert {fault.cause for fault in all_faults} - {None} == set(CAUSES)
    assert all(any(fault.middle for fault in all_faults if fault.name == name) for name in names - {"accumulated"})
    frame = drive[1]
    for fault in all_faults:
        altered = fault.alter(frame)
        assert altered.image.dtype == np.uint8 and altered.image.shape[2] == 3, fault
        assert altered.image.shape[:2] == (altered.camera.height, altered.camera.width), fault
        assert altered.points.dtype == np.float32 and np.isfinite(altered.points).all(), fault


def test_a_frame_alone_has_no_late_scan_and_no_map() -> None:
    frame = replace(Drive([0])[0], camera=PinholeCamera(64, 32, np.diag([50.0, 50.0, 1.0])))
    names = {fault.name for fault in corruptions(Drive([0]), 0, [frame])}
    assert not {"late-scan", "accumulated"} & names


def test_a_far_start_leaves_the_frame_and_widens_the_range() -> None:
    far = [fault for fault in corruptions(Drive([0]), 0, []) if fault.name == "far-start"]
    assert [fault.farther for fault in far] == [2, 3, 4] and all(fault.alter(FRAME) is FRAME for fault in far)
    assert Corruption("none", "", None, faults.unaltered).farther == 1
    assert transform(np.eye(3), np.zeros(3)).shape == (4, 4)
