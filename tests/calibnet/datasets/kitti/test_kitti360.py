"""KITTI-360: where its cameras are, its fisheyes, and what is wrong with a folder."""

from __future__ import annotations

import shutil

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose

from calibnet.datasets.calibration_files import read_calibration
from calibnet.datasets.discovery import find_sequences
from calibnet.errors import DatasetError
from tests.calibnet.datasets.conftest import VELODYNE_OFFSET, VELODYNE_ROTATION, small_turn
from tests.calibnet.datasets.published import FISHEYE_POSE, rigid

DRIVE = "2013_05_28_drive_0003_sync"


def add_fisheye(layout) -> None:
    folder = layout.root / "data_2d_raw" / DRIVE / "image_02" / "data_rgb"
    folder.mkdir(parents=True)
    for image in layout.images:
        cv2.imwrite(str(folder / image.name), np.full((60, 80, 3), 120, np.uint8))


def test_a_fisheye_is_read_with_its_lens(write_layout):
    layout = write_layout("kitti-360")
    add_fisheye(layout)
    frame = layout.open(camera=2)[0]
    camera = frame.as_taken.camera
    assert (camera.model, camera.width, camera.height) == ("omnidirectional", 80, 60)
    assert_allclose(camera.coefficients, [2.2, 0.016, 1.65, 0.0004, 0.0002])
    assert_allclose(camera.matrix, [[76, 0, 39.5], [0, 75, 29.5], [0, 0, 1]])
    pose_from_camera0 = rigid(small_turn(0.4, 1), [1.5, 0.4, 1.1])
    camera0_from_lidar = rigid(VELODYNE_ROTATION, VELODYNE_OFFSET)
    expected = np.linalg.inv(FISHEYE_POSE) @ pose_from_camera0 @ camera0_from_lidar
    assert_allclose(frame.camera_from_lidar, expected, atol=1e-9)
    assert frame.as_taken.image.shape == (60, 80, 3)


def test_images_and_scans_without_partner_are_counted(write_layout):
    layout = write_layout("kitti-360")
    layout.scans[1].unlink()
    sequence = layout.open()
    assert [frame.index for frame in sequence] == [3, 9]
    assert sequence.notes == ("1 image without a partner is left out (0000000006).",)


def test_all_drives_and_cameras_are_found(write_layout):
    layout = write_layout("kitti-360")
    add_fisheye(layout)
    found = [(one.name, one.rig) for one in find_sequences("kitti-360", layout.root)]
    assert found == [("kitti-360/0003", "KITTI-360, camera 1"), ("kitti-360/0003", "KITTI-360, camera 2")]
    assert list(find_sequences("kitti-360", layout.root, "0004")) == []


def test_what_is_missing_is_named(write_layout):
    layout = write_layout("kitti-360")
    with pytest.raises(DatasetError, match="has no drive 0004; drives there: 0003"):
        layout.open(drive=4)
    with pytest.raises(DatasetError, match=r"data_rgb does not exist; cameras there: 1\."):
        layout.open(camera=2)
    with pytest.raises(DatasetError, match="has no camera 7; choose 0 or 1"):
        layout.open(camera=7)
    (layout.root / "calibration" / "calib_cam_to_velo.txt").write_text("1 0 0 0 nan")
    with pytest.raises(DatasetError, match="is not one row of 12 finite numbers"):
        layout.open()
    shutil.rmtree(layout.root / "data_3d_raw")
    with pytest.raises(DatasetError, match="a KITTI-360 root holds calibration/"):
        layout.open()


def test_a_mei_file_of_camodocal_is_a_calibration_of_any_folder(write_layout):
    layout = write_layout("kitti-360")
    path = layout.root / "calibration" / "image_02.yaml"
    found = read_calibration(path)
    assert found.kind == "CamOdoCal's Mei model" and found.camera_from_lidar is None
    path.write_text(path.read_text().replace("   xi: 2.2\n", "   xii: 2.2\n"))
    with pytest.raises(DatasetError, match=r"has no mirror_parameters\.xi"):
        read_calibration(path)
