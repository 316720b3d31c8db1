"""Every real frame beside the repository loads, and as many of its points fall into the image as that sensor has."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pykitti
import pytest

from calibnet.datasets import open_sequence
from calibnet.geometry import project

DATE = "2011_09_26"
DRIVES = {
    "0002": (4, (2, 3)),
    "0005": (52, (2, 3)),
    "0009": (26, (2, 3)),
    "0013": (48, (2,)),
    "0048": (3, (2, 3)),
    "0051": (2, (2, 3)),
    "9001": (26, (2,)),
}
"""Frames and cameras of every drive in ../shared/kitti/raw."""


def points_in_image(frame) -> int:
    """Read off the frame's own projection; checks what every real frame must satisfy."""
    assert np.isfinite(frame.points).all()
    assert 0.0 <= frame.points[:, 3].min() < frame.points[:, 3].max() <= 1.0
    assert 0.0 < frame.camera.center[0] < frame.camera.width
    return len(project(frame.points, frame.camera_from_lidar, frame.camera).index)


def rows_of(path: Path) -> dict[str, list[float]]:
    rows = {}
    for line in path.read_text().splitlines():
        key, _, values = line.partition(": ")
        if values and not key.startswith("calib_time"):
            rows[key] = [float(value) for value in values.split()]
    return rows


def test_odometry_04(kitti_folder: Path):
    sequence = open_sequence("kitti-odometry", kitti_folder / "odometry", sequence="04")
    assert sequence.rig == "KITTI 2011_09_30, camera 2"
    frames = list(sequence)
    assert [frame.index for frame in frames] == list(range(12))
    for frame in frames:
        assert frame.image.shape == (370, 1226, 3)
        assert 115_000 < len(frame.points) < 130_000
        assert 16_000 < points_in_image(frame) < 21_000


@pytest.mark.parametrize("drive", DRIVES)
def test_raw_drives(drive: str, kitti_folder: Path):
    count, cameras = DRIVES[drive]
    for camera in cameras:
        sequence = open_sequence("kitti-raw", kitti_folder / "raw", date=DATE, drive=drive, camera=camera)
        assert len(sequence) == count
        numbers = [int(files.image.stem) for files in sequence.files]
        for number, frame in zip(numbers, sequence, strict=True):
            assert frame.index == number
            assert frame.image.shape == (375, 1242, 3)
            assert 30_000 < len(frame.points) < 60_000
            assert 14_000 < points_in_image(frame) < 22_000


@pytest.mark.parametrize(("split", "count"), [("training", 29), ("train", 21), ("val", 8)])
def test_object_frames(split: str, count: int, kitti_folder: Path):
    frames = list(open_sequence("kitti-object", kitti_folder / "object", split=split))
    assert len(frames) == count
    assert all(14_000 < points_in_image(frame) < 22_000 for frame in frames)


def test_object_lists_share_no_frame(kitti_folder: Path):
    train, val = (
        {files.index for files in open_sequence("kitti-object", kitti_folder / "object", split=split).files}
        for split in ("train", "val")
    )
    assert not train & val


@pytest.mark.parametrize("folder", ["rigs", "rigs-validation"])
def test_other_sensors(folder: str, kitti_folder: Path):
    rigs = [path for path in sorted((kitti_folder.parent / folder).iterdir()) if path.is_dir()]
    assert len(rigs) >= 5
    for rig in rigs:
        frames = list(open_sequence("folder", rig))
        assert [frame.index for frame in frames] == list(range(len(list((rig / "images").iterdir())))), rig
        for frame in frames:
            assert 600 < len(project(frame.points, frame.camera_from_lidar, frame.camera).index) < 60_000, rig


def exact_offset(projection: list[float]) -> tuple[float, float, float]:
    """``K^-1 P[:, 3]`` in plain arithmetic, for a K without skew."""
    (fx, _, cx, px), (_, fy, cy, py), (_, _, _, pz) = (projection[row : row + 4] for row in (0, 4, 8))
    return (px - cx * pz) / fx, (py - cy * pz) / fy, pz


def test_exact_extrinsic_of_odometry(kitti_folder: Path):
    rows = rows_of(kitti_folder / "odometry/sequences/04/calib.txt")
    expected = np.array(rows["Tr"]).reshape(3, 4)
    expected[:, 3] += exact_offset(rows["P2"])
    frame = open_sequence("kitti-odometry", kitti_folder / "odometry", sequence="04")[0]
    np.testing.assert_allclose(frame.camera_from_lidar[:3], expected, rtol=0, atol=1e-12)


def test_exact_extrinsic_differs_from_pykitti_by_millimetres(kitti_folder: Path):
    """pykitti takes ``P[0, 3] / fx`` for x and nothing for y and z: 2.7 mm of y/z, 3.6 mm in all."""
    root = kitti_folder / "raw"
    rows = rows_of(root / DATE / "calib_cam_to_cam.txt")
    velodyne = rows_of(root / DATE / "calib_velo_to_cam.txt")
    rectifying = np.array(rows["R_rect_00"]).reshape(3, 3)
    frame = open_sequence("kitti-raw", root, date=DATE, drive="0005")[0]
    np.testing.assert_allclose(
        frame.camera_from_lidar[:3, 3], rectifying @ velodyne["T"] + exact_offset(rows["P_rect_02"]), atol=1e-12
    )
    np.testing.assert_allclose(
        frame.camera_from_lidar[:3, :3], rectifying @ np.array(velodyne["R"]).reshape(3, 3), atol=1e-12
    )
    lost = frame.camera_from_lidar - pykitti.raw(str(root), DATE, "0005", imtype="jpg").calib.T_cam2_velo
    assert math.hypot(lost[1, 3], lost[2, 3]) == pytest.approx(0.00277, abs=5e-5)
    assert np.linalg.norm(lost[:3, 3]) == pytest.approx(0.0036, abs=5e-5)


def test_object_and_raw_agree_on_the_rig(kitti_folder: Path):
    """The object frames were cut from drives of 2011_09_26: both layouts must give one extrinsic."""
    by_object = open_sequence("kitti-object", kitti_folder / "object")[0]
    by_raw = open_sequence("kitti-raw", kitti_folder / "raw", date=DATE, drive="0005")[0]
    np.testing.assert_allclose(by_object.camera_from_lidar, by_raw.camera_from_lidar, rtol=0, atol=1e-9)
    np.testing.assert_allclose(by_object.camera.matrix, by_raw.camera.matrix, rtol=1e-12)
