"""A robot's description as the first guess."""

from __future__ import annotations

from pathlib import Path

import pytest
from numpy.testing import assert_allclose

from calibnet.datasets.calibration_files import FrameChoice, Wanted, read_calibration
from calibnet.errors import DatasetError
from calibnet.geometry import transform

ROBOT = """\
<?xml version="1.0" encoding="utf-8"?>
<robot name="cart">
  <link name="base_link"><inertial><mass value="3"/></inertial></link>
  <joint name="top" type="fixed">
    <parent link="base_link"/> <child link="velodyne"/> <origin xyz="0.5 0 1.5" rpy="0 0 0"/>
  </joint>
  <joint name="front" type="fixed">
    <origin xyz="0.7 0.0 1.4"/> <parent link="base_link"/> <child link="camera_link"/>
  </joint>
  <joint name="optical" type="fixed">
    <parent link="camera_link"/> <child link="camera_optical_frame"/>
    <origin xyz="0 0 0" rpy="-1.5707963267948966 0 -1.5707963267948966"/>
  </joint>
  <joint name="wheel" type="continuous"><parent link="base_link"/><child link="wheel"/></joint>
</robot>
"""
AHEAD = transform([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]], [0.0, -0.1, -0.2])
"""Camera from LiDAR: the camera 0.2 m ahead of the LiDAR and 0.1 m below it."""


def written(folder: Path, text: str) -> Path:
    path = folder / "cart.urdf"
    path.write_text(text)
    return path


def test_the_joints_between_camera_and_lidar_are_the_extrinsic(tmp_path: Path) -> None:
    found = read_calibration(written(tmp_path, ROBOT))
    assert found.camera is None and found.camera_from_lidar is not None
    assert_allclose(found.camera_from_lidar, AHEAD, atol=1e-12)


def test_frames_are_named_where_there_are_several(tmp_path: Path) -> None:
    second = '<joint name="l" type="fixed"><parent link="base_link"/><child link="livox"/></joint></robot>'
    path = written(tmp_path, ROBOT.replace("</robot>", second))
    with pytest.raises(DatasetError, match=r"several frames of a lidar .*; name it with --lidar-frame"):
        read_calibration(path)
    found = read_calibration(path, Wanted(frames=FrameChoice(None, "velodyne"))).camera_from_lidar
    assert found is not None
    assert_allclose(found, AHEAD, atol=1e-12)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('name="top" type="fixed"', 'name="top" type="revolute"', "no frame with the name of a lidar"),
        ("0.7 0.0 1.4", "${x} 0.0 1.4", r"is a xacro; expand it: xacro cart\.urdf > robot\.urdf"),
        ("0.7 0.0 1.4", "0.7 0.0", r"transform 2\.translation has 2 numbers instead of 3"),
        ("0.7 0.0 1.4", "0.7 0.0 high", r"transform 2\.translation is not a list of 3 numbers"),
        ('"fixed"', '"floating"', "is a URDF without fixed joints"),
        ("</link>", "", r"is not valid XML \(line 15\)"),
    ],
)
def test_what_cannot_be_read_is_one_sentence(old: str, new: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match=words):
        read_calibration(written(tmp_path, ROBOT.replace(old, new)))
