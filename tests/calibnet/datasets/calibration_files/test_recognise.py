"""Calibration files as other tools write them, told apart by what they hold, and each read for what it says."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose

from calibnet.datasets.calibration_files import FrameChoice, Wanted, read_calibration
from calibnet.errors import DatasetError
from calibnet.geometry import invert, transform
from calibnet.geometry.camera_model import CameraModel

MATRIX = np.array([[900.0, 0.0, 639.5], [0.0, 905.0, 359.5], [0.0, 0.0, 1.0]])
AXES = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
EXTRINSIC = transform(AXES, [0.0, -0.1, -0.2])
"""Camera from LiDAR: the camera 0.2 m ahead of the LiDAR and 0.1 m below it."""
ROWS = EXTRINSIC.tolist()

ROS = """\
image_width: 1280
image_height: 720
camera_name: front
camera_matrix: {rows: 3, cols: 3, data: [900.0, 0, 639.5, 0, 905.0, 359.5, 0, 0, 1]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [0.1, -0.2, 0.001, 0.002, 0]}
rectification_matrix: {rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}
projection_matrix: {rows: 3, cols: 4, data: [880, 0, 640, 0, 0, 885, 360, 0, 0, 0, 1, 0]}
"""
ROS_ECHO = """\
header: {frame_id: camera}
height: 720
width: 1280
distortion_model: equidistant
d: [0.1, -0.03, 0.001, 0.0]
k: [900.0, 0, 639.5, 0, 905.0, 359.5, 0, 0, 1]
r: [1, 0, 0, 0, 1, 0, 0, 0, 1]
p: [880, 0, 640, 0, 0, 885, 360, 0, 0, 0, 1, 0]
binning_x: 0
binning_y: 0
roi: {x_offset: 0, y_offset: 0, height: 0, width: 0, do_rectify: false}
"""
KALIBR = """\
cam0:
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [0.1, 0.01, 0.0, 0.0]
  distortion_model: equidistant
  intrinsics: [900.0, 905.0, 639.5, 359.5]
  resolution: [1280, 720]
  rostopic: /cam0/image_raw
cam1:
  T_cn_cnm1:
  - [1.0, 0.0, 0.0, -0.54]
  - [0.0, 1.0, 0.0, 0.0]
  - [0.0, 0.0, 1.0, 0.0]
  - [0.0, 0.0, 0.0, 1.0]
  camera_model: omni
  distortion_coeffs: [-0.1, 0.05, 0.001, 0.002]
  distortion_model: radtan
  intrinsics: [1.2, 900.0, 905.0, 639.5, 359.5]
  resolution: [1280, 720]
"""
DOUBLE_SPHERE = """\
cam0:
  camera_model: ds
  distortion_coeffs: []
  distortion_model: none
  intrinsics: [-0.2, 0.6, 900.0, 905.0, 639.5, 359.5]
  resolution: [1280, 720]
"""
KOIDE = {
    "camera": {
        "camera_model": "plumb_bob",
        "distortion_coeffs": [0.1, -0.2, 0, 0, 0],
        "intrinsics": [900, 905, 639.5, 359.5],
    },
    "meta": {"camera_info_topic": "/camera_info", "bag_names": ["a"]},
    "results": {
        "init_T_lidar_camera": [9.0, 9, 9, 0, 0, 0, 1],
        "T_lidar_camera": [0.2, 0.0, -0.1, -0.5, 0.5, -0.5, 0.5],
    },
}
TF_ECHO = """\
transforms:
- header: {stamp: {sec: 1, nanosec: 2}, frame_id: base_link}
  child_frame_id: velodyne
  transform: {translation: {x: 1.0, y: 0.0, z: 2.0}, rotation: {x: 0.0, y: 0.0, z: 0.0, w: 1.0}}
- header: {frame_id: base_link}
  child_frame_id: front_camera
  transform: {translation: {x: 1.2, y: 0.0, z: 1.9}, rotation: {x: 0.0, y: 0.0, z: 0.0, w: 1.0}}
- header: {frame_id: front_camera}
  child_frame_id: front_camera_optical
  transform: {translation: {x: 0.0, y: 0.0, z: 0.0}, rotation: {x: -0.5, y: 0.5, z: -0.5, w: 0.5}}
"""
AUTOWARE = """\
sensor_kit_base_link:
  camera0/camera_link: {x: 0.2, y: 0.0, z: -0.1, roll: 0.0, pitch: 0.0, yaw: 0.0}
  velodyne_top_base_link: {x: 0.0, y: 0.0, z: 0.0, roll: 0.0, pitch: 0.0, yaw: 0.0}
"""


@pytest.fixture
def write(tmp_path: Path) -> Callable[..., Path]:
    def call(text: str, name: str = "any name.txt") -> Path:
        path = tmp_path / name
        path.write_text(text)
        return path

    return call


@pytest.fixture
def picture(tmp_path: Path) -> Path:
    path = tmp_path / "picture.png"
    cv2.imwrite(str(path), np.zeros((720, 1280, 3), np.uint8))
    return path


def check_camera(found, kind: str, model: str, coefficients: list[float]) -> None:
    assert found.kind == kind
    assert (found.camera.width, found.camera.height, found.camera.model) == (1280, 720, model)
    assert_allclose(found.camera.matrix, MATRIX)
    assert_allclose(found.camera.coefficients, coefficients)


def test_camera_info_of_ros(write):
    found = read_calibration(write(ROS))
    check_camera(found, "ROS's camera_info", "plumb_bob", [0.1, -0.2, 0.001, 0.002, 0])
    assert found.camera_from_lidar is None
    found = read_calibration(write(ROS + f"camera_from_lidar: {ROWS}\n"))
    assert_allclose(found.camera_from_lidar, EXTRINSIC)


def test_camera_info_as_it_is_echoed(write):
    check_camera(read_calibration(write(ROS_ECHO)), "ROS's camera_info", "equidistant", [0.1, -0.03, 0.001, 0.0])
    old = ROS_ECHO.replace("d: [", "D: [").replace("k: [", "K: [").replace("equidistant", "plumb_bob")
    check_camera(read_calibration(write(old)), "ROS's camera_info", "plumb_bob", [0.1, -0.03, 0.001, 0.0])
    part = ROS_ECHO.replace("binning_x: 0", "binning_x: 2").replace("y_offset: 0", "y_offset: 8")
    found = read_calibration(write(part)).camera
    assert found is not None and (found.width, found.height) == (640, 712)
    assert_allclose(found.matrix, [[450.0, 0.0, 319.75], [0.0, 905.0, 351.5], [0.0, 0.0, 1.0]])
    with pytest.raises(DatasetError, match="binning_x is -1; give a whole number"):
        read_calibration(write(ROS_ECHO.replace("binning_x: 0", "binning_x: -1")))


def test_camchain_of_kalibr(write):
    path = write(KALIBR)
    found = read_calibration(path, Wanted("cam0"))
    check_camera(found, "Kalibr's camchain", "equidistant", [0.1, 0.01, 0.0, 0.0])
    assert_allclose(found.rig_from_camera, np.eye(4))
    found = read_calibration(path, Wanted("cam1"))
    check_camera(found, "Kalibr's camchain", "omnidirectional", [1.2, -0.1, 0.05, 0.001, 0.002])
    assert_allclose(found.rig_from_camera[:3, 3], [0.54, 0, 0])
    with pytest.raises(DatasetError, match="has the cameras cam0, cam1; choose one with --camera"):
        read_calibration(path)
    check_camera(read_calibration(write(DOUBLE_SPHERE)), "Kalibr's camchain", "double_sphere", [-0.2, 0.6])
    found = read_calibration(write(DOUBLE_SPHERE + f"  T_cam_lidar: {ROWS}\n"))
    assert_allclose(found.camera_from_lidar, EXTRINSIC)
    with pytest.raises(
        DatasetError, match="camera_model is 'eucm', which is not supported; calibrate with one of pinhole, omni, ds"
    ):
        read_calibration(write(DOUBLE_SPHERE.replace("ds", "eucm")))


@pytest.mark.parametrize("ending", ["yaml", "xml", "json"])
def test_file_storage_of_opencv(ending, tmp_path):
    path = tmp_path / f"stereo.{ending}"
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    storage.write("image_width", 1280)
    storage.write("image_height", 720)
    storage.write("calibration_time", "Thu 26 Nov 2026")
    storage.write("camera_matrix", MATRIX)
    storage.write("distortion_coefficients", np.array([[0.1, -0.2, 0.001, 0.002, 0.05]]))
    storage.write("camera_from_lidar", EXTRINSIC)
    storage.release()
    found = read_calibration(path)
    check_camera(found, "OpenCV's file", "plumb_bob", [0.1, -0.2, 0.001, 0.002, 0.05])
    assert_allclose(found.camera_from_lidar, EXTRINSIC)


def test_calib_json_of_koide3(write, picture):
    found = read_calibration(write(json.dumps(KOIDE)), Wanted(image=picture))
    check_camera(found, "koide3's calib.json", "plumb_bob", [0.1, -0.2, 0, 0, 0])
    assert_allclose(found.camera_from_lidar, EXTRINSIC, atol=1e-12)
    with pytest.raises(DatasetError, match="does not contain the size of the images"):
        read_calibration(write(json.dumps(KOIDE)))
    fisheye = {"camera_model": "fisheye", "distortion_coeffs": [0.1, 0, 0, 0], "intrinsics": [900, 905, 639.5, 359.5]}
    found = read_calibration(write(json.dumps({"camera": fisheye})), Wanted(image=picture))
    check_camera(found, "koide3's calib.json", "equidistant", [0.1, 0, 0, 0])
    assert found.camera_from_lidar is None


def test_transforms_between_frames(write):
    found = read_calibration(write(TF_ECHO))
    assert found.camera is None
    assert_allclose(found.camera_from_lidar, EXTRINSIC, atol=1e-12)
    by_hand = "- {parent: velodyne, child: cam_optical, translation: [0.2, 0, -0.1], rpy_deg: [-90, 0, -90]}\n"
    assert_allclose(read_calibration(write(by_hand)).camera_from_lidar, EXTRINSIC, atol=1e-12)
    alone = "header: {seq: 0, frame_id: velodyne64}\nchild_frame_id: front_camera\ntransform:\n"
    alone += "  translation: {x: 0.2, y: 0.0, z: -0.1}\n  rotation: {x: -0.5, y: 0.5, z: -0.5, w: 0.5}\n"
    assert_allclose(read_calibration(write(alone)).camera_from_lidar, EXTRINSIC, atol=1e-12)


def test_frames_are_named_where_their_names_do_not_tell(write):
    with pytest.raises(DatasetError, match="frame front_camera has its z axis up like the LiDAR"):
        read_calibration(write(TF_ECHO), Wanted(frames=FrameChoice("front_camera")))
    with pytest.raises(DatasetError, match="has no frame 'rear'; choose one of base_link, front_camera"):
        read_calibration(write(TF_ECHO), Wanted(frames=FrameChoice("rear")))
    other = "- {parent: base_link, child: rear_lidar, translation: [0, 0, 0], rpy_deg: [0, 0, 180]}\n"
    path = write(TF_ECHO + other)
    with pytest.raises(DatasetError, match=r"several frames of a lidar \(velodyne, rear_lidar\); name it"):
        read_calibration(path)
    assert_allclose(read_calibration(path, Wanted(frames=FrameChoice(None, "velodyne"))).camera_from_lidar, EXTRINSIC)


def test_a_frame_in_two_places_is_refused(write):
    twice = (
        "- header: {frame_id: base_link}\n  child_frame_id: velodyne\n  transform: {translation: {x: 1.1, y: 0, z: 2}, "
    )
    twice += "rotation: {x: 0, y: 0, z: 0, w: 1}}\n"
    with pytest.raises(DatasetError, match="has two different poses of velodyne in base_link"):
        read_calibration(write(TF_ECHO + twice))
    round_about = twice.replace("base_link", "front_camera_optical")
    with pytest.raises(DatasetError, match=r"has two paths from velodyne to .* that contradict each other"):
        read_calibration(write(TF_ECHO + round_about))
    assert_allclose(read_calibration(write(TF_ECHO + twice.replace("1.1", "1.0"))).camera_from_lidar, EXTRINSIC)


def test_frames_of_two_trees_are_not_connected(write):
    apart = "\n".join(line for line in TF_ECHO.splitlines() if line)
    apart = apart.replace(
        "frame_id: base_link}\n  child_frame_id: front_camera", "frame_id: odom}\n  child_frame_id: front_camera"
    )
    with pytest.raises(DatasetError, match="does not connect front_camera_optical with velodyne"):
        read_calibration(write(apart))


def test_what_topic_echo_prints_ends_in_dashes(write):
    """One message, several alike, and transforms of several publishers."""
    found = read_calibration(write(ROS_ECHO + "---\n"))
    check_camera(found, "ROS's camera_info", "equidistant", [0.1, -0.03, 0.001, 0.0])
    later = ROS_ECHO.replace("frame_id: camera", "frame_id: camera, stamp: {sec: 7}")
    assert read_calibration(write(f"{ROS_ECHO}---\n{later}---\n")).camera.model == "equidistant"
    with pytest.raises(DatasetError, match="has 2 different messages"):
        read_calibration(write(f"{ROS_ECHO}---\n{later.replace('1280', '640')}---\n"))
    first, rest = TF_ECHO.split("- header: {frame_id: base_link}", 1)
    two = f"{first}---\ntransforms:\n- header: {{frame_id: base_link}}{rest}---\n"
    assert_allclose(read_calibration(write(two)).camera_from_lidar, EXTRINSIC, atol=1e-12)
    with pytest.raises(DatasetError, match="has 5000 messages"):
        read_calibration(write("a: 1\n---\n" * 5000))


@pytest.mark.parametrize("header", ["%YAML:1.0\n---\n", "%YAML 1.0\n---\n"])
def test_opencv_of_any_age(header, write):
    """Before version 3 it put no space behind a key."""
    colon = ":" if ":1.0" in header else ": "
    text = header + f"image_width{colon}1280\nimage_height{colon}720\ncamera_matrix: !!opencv-matrix\n   rows{colon}3\n"
    text += f"   cols{colon}3\n   dt{colon}d\n   data{colon}{MATRIX.ravel().tolist()}\n"
    text += "distortion_coefficients: [0.1, -0.2, 0.001, 0.002, 0]\n"
    check_camera(read_calibration(write(text)), "OpenCV's file", "plumb_bob", [0.1, -0.2, 0.001, 0.002, 0])


def test_calibration_of_autoware(write):
    found = read_calibration(write(AUTOWARE))
    assert found.kind == "Autoware's calibration"
    assert_allclose(found.camera_from_lidar, EXTRINSIC, atol=1e-12)


OURS = f"width: 1280\nheight: 720\ncamera_matrix: {MATRIX.tolist()}\ndistortion: [0, 0, 0, 0, 0]\n"


@pytest.mark.parametrize(
    "spelling",
    [
        f"camera_from_lidar: {np.ravel(ROWS).tolist()}",
        f"camera_from_lidar: {np.ravel(ROWS)[:12].tolist()}",
        f"lidar_from_camera: {invert(EXTRINSIC).tolist()}",
        f"camera_from_lidar: {{translation: [0, -0.1, -0.2], rotation: {AXES.tolist()}}}",
        "camera_from_lidar: {translation: [0, -0.1, -0.2], quaternion_xyzw: [0.5, -0.5, 0.5, 0.5]}",
        "camera_from_lidar: {translation: [0, -0.1, -0.2], quaternion_wxyz: [0.5, 0.5, -0.5, 0.5]}",
        "camera_from_lidar: {translation: {x: 0, y: -0.1, z: -0.2}, rotation: {w: 0.5, x: 0.5, y: -0.5, z: 0.5}}",
        "camera_from_lidar: {quaternion: {x: 0.5, y: -0.5, z: 0.5, w: 0.5}, translation: {z: -0.2, y: -0.1, x: 0}}",
        "lidar_from_camera: {translation: [0.2, 0, -0.1], rpy_deg: [-90, 0, -90]}",
        "lidar_from_camera: {translation: [0.2, 0, -0.1], rpy_rad: [-1.5707963267948966, 0, -1.5707963267948966]}",
    ],
)
def test_an_extrinsic_in_any_form_and_either_direction(spelling, write):
    found = read_calibration(write(OURS + spelling))
    assert_allclose(found.camera_from_lidar, EXTRINSIC, atol=1e-9)


@pytest.mark.parametrize(
    ("spelling", "problem"),
    [
        ("camera_from_lidar: {translation: [0, 0, 0], rotation: [0.5, -0.5, 0.5, 0.5]}", "in an unknown order"),
        ("camera_from_lidar: {translation: [0, 0, 0], quaternion_xyzw: [1, 1, 0, 0]}", "has length 1.41 instead of 1"),
        ("camera_from_lidar: {translation: [0, 0, 0]}", "has 0 rotations"),
        (
            "camera_from_lidar: {translation: [0, 0, 0], rpy_rad: [-90, 0, -90]}",
            "is more than a full turn; call angles in deg",
        ),
        ("camera_from_lidar: {rpy_deg: [0, 0, 0]}", "has no 'translation'"),
        ("camera_from_lidar: {translation: [0, 0, 0], rpy_deg: [0, 0, 0], units: mm}", "an unknown 'units'"),
        (f"camera_from_lidar: {ROWS}\nlidar_from_camera: {ROWS}", "contradict each other"),
        ("width: 640", "the key 'width' is given twice"),
        ("distortion_model: omnidirectional", "has no key 'xi'"),
        ("distortion_model: equidistant", None),
        ("cloud_columns: [x, y, intensity]", "cloud_columns is"),
    ],
)
def test_what_cannot_be_meant_is_refused(spelling, problem, write):
    path = write(OURS + spelling)
    if problem is None:
        assert read_calibration(path).camera.model == "equidistant", "a fifth zero does not count"
        return
    with pytest.raises(DatasetError, match=problem) as caught:
        read_calibration(path)
    assert str(path) in str(caught.value)


def test_a_file_of_an_extrinsic_alone_is_a_guess(write):
    found = read_calibration(write(f"camera_from_lidar: {ROWS}"))
    assert found.camera is None
    assert_allclose(found.camera_from_lidar, EXTRINSIC)


@pytest.mark.parametrize(
    "text",
    [
        "<opencv_storage><a",
        "{" * 3000,
        "[" * 100_000,
        "a: &a [*a]",
        "%YAML:1.0\n---\n: :",
        "\0",
        "2001-99-99",
        "? [a]\n: b",
    ],
)
def test_garbage_is_one_sentence(text, write):
    path = write(text)
    with pytest.raises(DatasetError) as caught:
        read_calibration(path)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("from launch import LaunchDescription\nx = {'a': 1}\n", "is a program, which is not run; print its numbers"),
        ("#!/usr/bin/env python3\nimport os\nprint('a: 1')\n", "is a program, which is not run"),
        (
            "At time 12.5\n- Translation: [0.1, 0.2, 0.3]\n- Rotation: in Quaternion [0.5, -0.5, 0.5, 0.5]\n",
            "is printed by tf_echo, which does not name its frames; if that was 'tf2_echo LIDAR CAMERA', take",
        ),
        ("0 -1 0 0.1\n0 0 -1 0.2\n1 0 0 0.3\n0 0 0 1\n", "the direction of the extrinsic is unknown; name its matrix"),
        ("[[0,-1,0,1e-1],[0,0,-1,.2],[1,0,0,.3],[0,0,0,1]]", "the direction of the extrinsic is unknown"),
        ("%YAML:1.0\n---\nM1: [1, 0, 0]\nD1: [0]\nM2: [1, 0, 0]\n", "has two cameras \\(M1, M2\\); keep the matrix"),
    ],
)
def test_what_others_print_without_names_says_what_to_do(text, sentence, write):
    with pytest.raises(DatasetError, match=sentence):
        read_calibration(write(text))


LAUNCHED = {
    "ROS 2, YAML": "launch:\n- group:\n  - node: {pkg: tf2_ros, exec: static_transform_publisher, args: "
    "'--x 0.2 --z -0.1 --roll -1.5707963267948966 --yaw -1.5707963267948966 --frame-id velodyne "
    "--child-frame-id cam_optical'}\n- node: {pkg: a, exec: b}\n",
    "ROS 2, XML": "<launch><group><node pkg='tf2_ros' exec='static_transform_publisher' args='0.2 0 -0.1 -0.5 0.5 "
    "-0.5 0.5 velodyne cam_optical'/></group></launch>",
    "ROS 1": "<launch><node pkg='tf' type='static_transform_publisher' name='x' args='0.2 0 -0.1 -1.5707963267948966 0 "
    "-1.5707963267948966 /velodyne /cam_optical 100'/></launch>",
}


@pytest.mark.parametrize("way", LAUNCHED)
def test_transforms_that_a_launch_file_publishes(way, write):
    found = read_calibration(write(LAUNCHED[way]))
    assert found.camera is None
    assert_allclose(found.camera_from_lidar, EXTRINSIC, atol=1e-12)


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ("$(arg x) 0 0 0 0 0 a b", "filled in at launch"),
        ("1 2 3 4 5 velodyne cam_optical", "are not of the form --x"),
        ("--x 1 --frame-id velodyne", "are not of the form --x"),
        ("", "are not of the form --x"),
        ("0 0 0 7 0 0 0 velodyne cam_optical", "quaternion .* has length 7"),
    ],
)
def test_a_launch_file_that_leaves_something_open_is_refused(arguments, sentence, write):
    with pytest.raises(DatasetError, match=sentence):
        read_calibration(write(f"<launch><node type='static_transform_publisher' args='{arguments}'/></launch>"))
    with pytest.raises(DatasetError, match="launch file without a static_transform_publisher"):
        read_calibration(write("launch:\n- arg: {name: x}\n"))


ODOMETRY = (
    "P0: 700 0 640 0 0 700 360 0 0 0 1 0\nP2: 700 0 640 35 0 700 360 -7 0 0 1 0\nTr: 0 -1 0 0 0 0 -1 -0.1 1 0 0 -0.2\n"
)


def test_calibration_of_kitti(write):
    wanted = Wanted("2", image=(1280, 720))
    found = read_calibration(write(ODOMETRY), wanted)
    matrix = np.array([[700.0, 0, 640], [0, 700, 360], [0, 0, 1]])
    assert found.camera is not None and found.camera.same(CameraModel(1280, 720, matrix))
    assert_allclose(invert(found.camera_from_lidar)[:3, 3], [0.2, 0.05, -0.11], atol=1e-12)
    assert_allclose(read_calibration(write(ODOMETRY), Wanted("0")).camera_from_lidar, EXTRINSIC)
    with pytest.raises(DatasetError, match="has the cameras 0, 2; choose one with --camera"):
        read_calibration(write(ODOMETRY))
    of_object = ODOMETRY.replace("Tr:", "R0_rect: 1 0 0 0 1 0 0 0 1\nTr_velo_to_cam:")
    assert_allclose(read_calibration(write(of_object), Wanted("P0")).camera_from_lidar, EXTRINSIC)
    with pytest.raises(DatasetError, match="row 'Tr' has 11 numbers instead of 12"):
        read_calibration(write(ODOMETRY.replace(" -0.2", "")), Wanted("0"))
