"""A synthetic drive written as KITTI odometry reads back as it was, through pykitti and our loader."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pykitti
import pytest

from calibnet.datasets import open_sequence
from calibnet.datasets.synthetic import KITTI_LIKE, SyntheticSequence, write_kitti_odometry
from calibnet.errors import DatasetError

SMALL = dataclasses.replace(
    KITTI_LIKE,
    camera=KITTI_LIKE.camera.resized(310, 94),
    lidar=dataclasses.replace(KITTI_LIKE.lidar, azimuth_step=np.radians(1.0)),
)


def test_written_drive_reads_back_exactly(tmp_path: Path):
    drive, counted = SyntheticSequence(4, 3, SMALL), []
    write_kitti_odometry(drive, tmp_path, "07", counted.append)
    assert counted == [1, 2, 3]

    loaded = open_sequence("kitti-odometry", tmp_path, sequence="07")
    assert len(loaded) == 3
    for written, read in zip(drive, loaded, strict=True):
        np.testing.assert_array_equal(read.image, written.image)
        np.testing.assert_array_equal(read.points, written.points)
        np.testing.assert_allclose(read.camera_from_lidar, written.camera_from_lidar, rtol=0, atol=1e-12)
        np.testing.assert_allclose(read.camera.matrix, written.camera.matrix, rtol=1e-12)
        assert read.timestamp == pytest.approx(written.timestamp, abs=1e-6)


def test_pykitti_reads_images_scans_and_poses(tmp_path: Path):
    drive = SyntheticSequence(4, 3, SMALL)
    write_kitti_odometry(drive, tmp_path)
    dataset = pykitti.odometry(str(tmp_path), "00")
    assert len(dataset.poses) == len(dataset) == 3
    np.testing.assert_allclose(dataset.calib.T_cam2_velo, SMALL.camera_from_lidar, atol=1e-12)
    np.testing.assert_array_equal(np.asarray(dataset.get_cam2(1)), drive[1].image)
    np.testing.assert_array_equal(dataset.get_velo(1), drive[1].points)
    np.testing.assert_allclose(dataset.poses[0], np.eye(4), atol=1e-12)
    # The camera looks ahead: after two frames it is about two metres along its own axis.
    assert dataset.poses[2][2, 3] == pytest.approx(2.0, abs=0.3)


def test_scans_of_a_still_scene_agree_through_the_poses(tmp_path: Path):
    """Points of two frames, brought into one by the written poses, lie on the same ground."""
    drive = SyntheticSequence(4, 9, SMALL)
    write_kitti_odometry(drive, tmp_path)
    dataset = pykitti.odometry(str(tmp_path), "00")
    clouds = []
    for position in (0, 8):
        points = np.column_stack([dataset.get_velo(position)[:, :3], np.ones(len(dataset.get_velo(position)))])
        clouds.append((dataset.poses[position] @ SMALL.camera_from_lidar @ points.T).T[:, :3])
    near = clouds[1][(np.abs(clouds[1][:, 0]) < 8) & (clouds[1][:, 2] > 9) & (clouds[1][:, 2] < 16)]
    assert len(near) > 100
    gaps = [np.linalg.norm(clouds[0] - point, axis=1).min() for point in near]
    assert np.median(gaps) < 0.35


def test_a_folder_that_cannot_be_written_is_named(tmp_path: Path):
    blocked = tmp_path / "file"
    blocked.write_text("not a folder")
    with pytest.raises(DatasetError, match="file"):
        write_kitti_odometry(SyntheticSequence(4, 1, SMALL), blocked)
