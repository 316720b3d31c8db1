"""``calib-inspect export``, read back by the parsers that other people use."""

from __future__ import annotations

import json
import shlex
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import cv2
import numpy as np
import pykitti
import pytest
import yaml

from calibnet.geometry import invert
from calibnet.geometry.median import median_pose
from inspector.cli.errors import run
from inspector.cli.main import cli
from inspector.export.exported import exported_drive, exported_median
from inspector.export.formats import quaternion_xyzw
from inspector.read.run import RecordedRun, read_run
from inspector.read.understood import RecordingError
from tests.support.judged import REASON, UNSURE


@pytest.fixture(scope="module")
def recording(record: Callable[..., Any], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three frames, each from another start, so that their results differ."""
    file = tmp_path_factory.mktemp("export") / "run.rrd"
    record(file, detail="overview", strides=(32,), per_frame=True)
    return file


@pytest.fixture
def recorded(recording: Path) -> RecordedRun:
    return read_run(recording)


@pytest.fixture
def own_folder(tmp_path: Path, fakes: ModuleType) -> Path:
    """A folder with nothing but a calibration, of a lens with distortion."""
    calibration = {
        "width": 640,
        "height": 480,
        "camera_matrix": [[500.1, 0.0, 320.2], [0.0, 501.3, 240.4], [0.0, 0.0, 1.0]],
        "distortion": [-0.3, 0.1, 0.001, -0.002, 0.05],
        "camera_from_lidar": fakes.REFERENCE.tolist(),
    }
    (tmp_path / "calibration.yaml").write_text(yaml.safe_dump(calibration))
    return tmp_path


@pytest.fixture
def export(capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    def call(*arguments: object, code: int = 0) -> str:
        assert run(cli, ["export", *map(str, arguments)]) == code
        out, err = capsys.readouterr()
        return out if code == 0 else err

    return call


def arguments_of(line: str) -> dict[str, str]:
    """``--name value`` pairs of a static_transform_publisher's command line."""
    words = shlex.split(line)
    start = next(position for position, word in enumerate(words) if word.startswith("--"))
    return dict(zip(words[start::2], words[start + 1 :: 2], strict=True))


def matrix_of(arguments: dict[str, str]) -> np.ndarray:
    """Quaternion to matrix in OpenCV's way, which is not ours."""
    x, y, z, w = (float(arguments[f"--q{axis}"]) for axis in "xyzw")
    sine = np.linalg.norm([x, y, z])
    vector = np.array([x, y, z]) / sine * 2.0 * np.arctan2(sine, w)
    matrix = np.eye(4)
    matrix[:3, :3] = cv2.Rodrigues(vector)[0]
    matrix[:3, 3] = [float(arguments[f"--{axis}"]) for axis in "xyz"]
    return matrix


def test_kitti_is_read_by_pykitti(
    export: Callable[..., str], recording: Path, recorded: RecordedRun, tmp_path: Path
) -> None:
    sequence = tmp_path / "sequences" / "00"
    sequence.mkdir(parents=True)
    (sequence / "times.txt").write_text("0.0\n")
    export(recording, "--format", "kitti", "--frame", 1, "--output", sequence / "calib.txt")
    calibration = pykitti.odometry(str(tmp_path), "00").calib
    frame = recorded.frames[1]
    for camera in range(4):
        np.testing.assert_array_equal(getattr(calibration, f"T_cam{camera}_velo"), frame.corrected)
        np.testing.assert_array_equal(getattr(calibration, f"K_cam{camera}"), frame.camera.matrix)
    assert "# convention: Tr = camera_from_lidar" in (sequence / "calib.txt").read_text()


@pytest.mark.parametrize("parent", ["lidar", "camera"])
def test_ros_launch_and_command_line_say_parent_from_child(
    export: Callable[..., str], recording: Path, recorded: RecordedRun, parent: str
) -> None:
    names = ("--camera-frame", "cam/optical", "--lidar-frame", "velodyne")
    text = export(recording, "--format", "ros", "--frame", 0, "--parent", parent, *names)
    node = yaml.safe_load(text)["launch"][0]["node"]
    assert (node["pkg"], node["exec"]) == ("tf2_ros", "static_transform_publisher")
    arguments = arguments_of(node["args"])
    (command,) = [line for line in text.splitlines() if "ros2 run" in line]
    assert arguments_of(command) == arguments
    camera_from_lidar = recorded.frames[0].corrected
    if parent == "lidar":
        assert (arguments["--frame-id"], arguments["--child-frame-id"]) == ("velodyne", "cam/optical")
        np.testing.assert_allclose(matrix_of(arguments), invert(camera_from_lidar), atol=1e-9)
    else:
        assert (arguments["--frame-id"], arguments["--child-frame-id"]) == ("cam/optical", "velodyne")
        np.testing.assert_allclose(matrix_of(arguments), camera_from_lidar, atol=1e-9)


def test_opencv_yaml_is_read_by_file_storage(
    export: Callable[..., str], recording: Path, recorded: RecordedRun, tmp_path: Path
) -> None:
    file = tmp_path / "new" / "calibration.yaml"
    export(recording, "--format", "opencv", "--frame", 2, "--output", file)
    storage = cv2.FileStorage(str(file), cv2.FILE_STORAGE_READ)
    frame = recorded.frames[2]
    np.testing.assert_allclose(storage.getNode("camera_from_lidar").mat(), frame.corrected, atol=1e-12)
    np.testing.assert_allclose(storage.getNode("camera_matrix").mat(), frame.camera.matrix, atol=1e-12)
    assert storage.getNode("image_width").real() == frame.camera.width
    points = np.array([[20.0, 1.0, -0.5], [8.0, -2.0, 0.3]])
    names = ("rvec", "tvec", "camera_matrix", "distortion_coefficients")
    pixels = cv2.projectPoints(points, *(storage.getNode(name).mat() for name in names))[0][:, 0]
    seen = (points @ frame.corrected[:3, :3].T + frame.corrected[:3, 3]) @ frame.camera.matrix.T
    np.testing.assert_allclose(pixels, seen[:, :2] / seen[:, 2:], atol=1e-9)
    assert "# camera_from_lidar maps LiDAR points" in file.read_text()


def test_what_is_rejected_is_exported_by_force_alone(
    export: Callable[..., str], record: Callable[..., Any], tmp_path: Path
) -> None:
    some, none = tmp_path / "some.rrd", tmp_path / "none.rrd"
    record(some, detail="overview", strides=(32,), doubted=(1,), per_frame=True)
    record(none, detail="overview", strides=(32,), doubted=(0, 1, 2))
    frames = read_run(some).frames
    content = json.loads(export(some, "--format", "json"))
    np.testing.assert_allclose(
        content["camera_from_lidar"], median_pose([frames[0].corrected, frames[2].corrected]), atol=1e-12
    )
    assert "median of 2 frames" in json.dumps(content)
    refusal = f"calib-inspect: Rejected. {REASON} Nothing was written; --force writes it.\n"
    assert export(some, "--format", "json", "--frame", 1, "--output", tmp_path / "out.json", code=1) == refusal
    assert not (tmp_path / "out.json").exists()
    forced = json.loads(export(some, "--format", "json", "--frame", 1, "--force"))
    np.testing.assert_array_equal(forced["camera_from_lidar"], frames[1].stages[5])  # what was found, not the start
    assert forced["source"].endswith(f"frame 1; rejected: {REASON}")
    assert "Rejected. Of 3 frames 0 accepted, 3 rejected" in export(none, "--format", "json", code=1)
    assert "median of 3 frames; rejected: " in json.loads(export(none, "--format", "json", "--force"))["source"]


@pytest.mark.parametrize("form", ["kitti", "ros", "opencv", "json"])
def test_what_cannot_be_told_is_exported_with_a_warning_in_the_file(
    record: Callable[..., Any], tmp_path: Path, capsys: pytest.CaptureFixture[str], form: str
) -> None:
    file, out = tmp_path / "unsure.rrd", tmp_path / "out"
    record(file, length=1, detail="overview", strides=(32,), unsure=(0,))
    assert run(cli, ["export", str(file), "--format", form, "--frame", "0", "--output", str(out)]) == 0
    assert capsys.readouterr().err.startswith(f"calib-inspect: Cannot tell. {UNSURE} It was written.\n")
    (line,) = [line for line in out.read_text().splitlines() if UNSURE in line]
    assert "frame 0; cannot tell: " in line and (form == "json" or line.startswith("#"))
    assert run(cli, ["export", str(file), "--format", form, "--frame", "0", "--output", str(file)]) == 3
    assert "It was written" not in capsys.readouterr().err


def test_json_is_the_median_unless_a_frame_is_named(
    export: Callable[..., str], recording: Path, recorded: RecordedRun
) -> None:
    content = json.loads(export(recording, "--format", "json"))
    median = median_pose([frame.corrected for frame in recorded.frames])
    np.testing.assert_array_equal(content["camera_from_lidar"], median)
    np.testing.assert_allclose(np.array(content["lidar_from_camera"]) @ median, np.eye(4), atol=1e-12)
    assert content["convention"].startswith("camera_from_lidar maps LiDAR points into the camera")
    assert "median of 3 frames" in content["source"]
    assert content == json.loads(export(recording, "--format", "json", "--median"))
    one = json.loads(export(recording, "--format", "json", "--frame", 0))
    np.testing.assert_array_equal(one["camera_from_lidar"], recorded.frames[0].corrected)


def test_the_estimate_from_the_whole_drive(recorded: RecordedRun) -> None:
    drive = recorded.frames[0].initial
    exported = exported_drive(replace(recorded, drive=drive))
    assert exported.camera_from_lidar is drive
    assert "all frames solved together" in exported.origin


def test_a_folders_calibration_keeps_its_distortion(
    export: Callable[..., str], own_folder: Path, fakes: ModuleType
) -> None:
    content = json.loads(export("--folder", own_folder, "--format", "json"))
    np.testing.assert_array_equal(content["camera_from_lidar"], fakes.REFERENCE)
    assert content["distortion_coefficients"] == [-0.3, 0.1, 0.001, -0.002, 0.05]
    assert (content["image_width"], content["image_height"]) == (640, 480)


@pytest.mark.parametrize("vector", [[0.0, 0.0, 0.0], [np.pi, 0.0, 0.0], [0.0, -np.pi, 0.0], [1.2, -2.0, 0.4]])
def test_quaternions_of_any_rotation(vector: list[float]) -> None:
    rotation = cv2.Rodrigues(np.array(vector))[0]
    x, y, z, w = quaternion_xyzw(rotation)
    assert w >= 0.0
    angle = 2.0 * np.arctan2(np.linalg.norm([x, y, z]), w)
    axis = np.array([x, y, z]) / max(float(np.linalg.norm([x, y, z])), 1e-300)
    np.testing.assert_allclose(cv2.Rodrigues(axis * angle)[0], rotation, atol=1e-12)


def test_frames_of_several_mounts_have_no_median(recorded: RecordedRun) -> None:
    first, *others = recorded.frames
    moved = first.reference.copy()
    moved[0, 3] += 0.1
    with pytest.raises(RecordingError, match="several cameras or mounts; choose one frame with --frame"):
        exported_median(replace(recorded, frames=(replace(first, reference=moved), *others)))


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        ((), 2, "Give a recording or --folder"),
        (("RUN", "--folder", "x"), 2, "Give a recording or --folder"),
        (("RUN", "--frame", 1, "--median"), 2, "one of --frame, --median and --drive"),
        (("--folder", "x", "--median"), 2, "leave them out with --folder"),
        (("RUN", "--lidar-frame", "two words"), 2, "not a valid ROS frame name"),
        (("RUN", "--drive"), 3, "record it with --drive"),
        (("RUN", "--frame", 9), 3, "has no complete frame 9; choose one from 0 to 2"),
        (("--folder", "nowhere"), 3, "cannot be read"),
        (("nowhere.rrd",), 3, "nowhere.rrd does not exist"),
    ],
)
def test_what_cannot_be_exported(
    export: Callable[..., str], recording: Path, arguments: tuple[object, ...], code: int, message: str
) -> None:
    given = [recording if argument == "RUN" else argument for argument in arguments]
    assert message in export(*given, "--format", "ros", code=code)
