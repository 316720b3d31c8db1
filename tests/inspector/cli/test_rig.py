"""``calib-inspect rig``: how a rig lies in folders, where its cameras are relative to each other, and what is said."""

from __future__ import annotations

import json
import os
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from numpy.testing import assert_allclose

from calibnet.cascade.cascade import Cascade
from calibnet.datasets.calibration_files import read_calibration
from calibnet.drive.rig import CameraEstimate, RigEstimate
from calibnet.errors import DatasetError
from calibnet.geometry import invert, miscalibration, rotation_from_vector, transform
from calibnet.geometry.se3 import adjoint
from calibnet.runtime.claim import locked
from calibnet.trace import DriveEstimate
from calibnet.verdict import Verdict, Word, moved
from inspector import entities
from inspector.cli.errors import run
from inspector.cli.main import cli
from inspector.read.rig import is_rig, read_rig
from inspector.run.rig import open_rig, poses
from tests.support.fakes import REFERENCE
from tests.support.folder import write_folder

RIGHT_FROM_LEFT = transform(rotation_from_vector([0.0, 0.02, 0.0]), [-0.5, 0.0, 0.0])
FOUND = miscalibration([0.1, 0.2, 0.3], [0.01, 0.02, 0.03])
ALONE = np.array([0.03, 0.0, 0.04, 0.0, np.radians(0.5), 0.0])
"""How far a camera's own frames say that it is from what is found: 0.5 degrees and 5 cm."""
COVARIANCE = np.diag([0.01**2] * 3 + [0.001**2] * 3)
Invoke = Callable[..., tuple[int, str, str]]


class RigCascade:
    """Finds `FOUND` before the start, whatever it sees."""

    word: Word = "accepted"

    def _estimate(self, initial: np.ndarray) -> DriveEstimate:
        found = FOUND @ initial
        verdict = Verdict(self.word, "Because.", found, moved(initial, found), (), COVARIANCE, 2)
        return DriveEstimate(found, COVARIANCE, 2, verdict=verdict)

    def calibrate_drive(self, frames: Any, initial: np.ndarray, observer: Any = None) -> DriveEstimate:
        assert len(frames) == 2
        return self._estimate(initial)

    def calibrate_rig(
        self, cameras: Any, initial: np.ndarray, observer: Any = None, tolerance: Any = None
    ) -> RigEstimate:
        observer(1, 2)
        self.tolerance = tolerance
        rig = self._estimate(initial)
        found = []
        for camera in cameras:
            to_camera = adjoint(camera.camera_from_rig)
            there, covariance = camera.camera_from_rig @ rig.camera_from_lidar, to_camera @ COVARIANCE @ to_camera.T
            found.append(CameraEstimate(camera.name, there, covariance, 2, 1.5, ALONE, COVARIANCE))
        return RigEstimate(rig.camera_from_lidar, COVARIANCE, 2, verdict=rig.verdict, cameras=tuple(found))


LOADED = RigCascade()


@pytest.fixture
def invoke(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> Invoke:
    monkeypatch.setattr(Cascade, "load", staticmethod(lambda *_: LOADED))
    monkeypatch.chdir(tmp_path)

    def call(*arguments: str) -> tuple[int, str, str]:
        code = run(cli, ["rig", *arguments] if arguments[0] not in ("export", "report") else list(arguments))
        return code, *capsys.readouterr()

    return call


def change(folder: Path, **values: Any) -> None:
    path = folder / "calibration.yaml"
    content = yaml.safe_load(path.read_text())
    path.write_text(yaml.safe_dump({name: value for name, value in (content | values).items() if value is not None}))


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    """Two cameras that share the scans."""
    root = tmp_path / "my rig"
    for name in ("left", "right"):
        write_folder(root / "cameras" / name, 2)
    shutil.move(root / "cameras" / "left" / "clouds", root / "clouds")
    shutil.rmtree(root / "cameras" / "right" / "clouds")
    change(root / "cameras" / "right", camera_from_lidar=(RIGHT_FROM_LEFT @ REFERENCE).tolist())
    return root


def test_a_rig_is_one_folder_or_one_for_each_camera(rig: Path, tmp_path: Path) -> None:
    cameras = open_rig([rig])
    assert list(cameras) == ["left", "right"]
    assert [len(camera[0].points) for camera in cameras.values()] == [6000, 6000]
    apart = [write_folder(tmp_path / name, 1) for name in ("b", "a")]
    assert list(open_rig(apart)) == ["b", "a"]


def test_what_is_no_rig(rig: Path, tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="is not a rig's folder; put a folder with images/ and"):
        open_rig([tmp_path])
    other = write_folder(tmp_path / "other" / "left", 1)
    with pytest.raises(DatasetError, match="Two cameras are called left"):
        open_rig([write_folder(tmp_path / "more" / "left", 1), other])


def test_cameras_are_relative_to_each_other_as_the_extrinsics_say(rig: Path) -> None:
    camera_from_rig, start = poses(open_rig([rig]), rigid=True)
    assert_allclose(start, REFERENCE)
    assert_allclose(camera_from_rig["left"], np.eye(4), atol=1e-12)
    assert_allclose(camera_from_rig["right"], RIGHT_FROM_LEFT, atol=1e-12)


def test_rig_from_camera_goes_before_the_extrinsics(rig: Path) -> None:
    body_from_left = transform(rotation_from_vector([0.1, 0.2, 0.3]), [1.0, 2.0, 3.0])
    other = transform(rotation_from_vector([0.0, -0.01, 0.0]), [0.6, 0.0, 0.0])
    change(rig / "cameras" / "left", rig_from_camera=body_from_left.tolist())
    with pytest.raises(DatasetError, match="Only some calibrations have rig_from_camera; add it to those of right"):
        poses(open_rig([rig]), rigid=True)
    change(rig / "cameras" / "right", rig_from_camera=(body_from_left @ other).tolist())
    camera_from_rig, start = poses(open_rig([rig]), rigid=True)
    assert_allclose(camera_from_rig["right"], invert(other), atol=1e-9)
    assert_allclose(start, REFERENCE)


def test_an_extrinsic_that_is_not_used_is_told_and_one_that_contradicts_refused(rig: Path, invoke: Invoke) -> None:
    off = transform(np.eye(3), [0.03, 0.0, 0.0])
    left, right = rig / "cameras" / "left", rig / "cameras" / "right"
    change(left, rig_from_camera=np.eye(4).tolist())
    change(right, rig_from_camera=invert(off @ RIGHT_FROM_LEFT).tolist())
    assert "rig_from_camera" not in invoke(str(rig))[2], "one by one, each starts from its own extrinsic"
    told = "right: its extrinsic is 0.00° / 3.0 cm from its place by rig_from_camera, which is used."
    assert told in invoke(str(rig), "--rigid")[2]
    body = transform(rotation_from_vector([0.0, np.pi / 2, 0.0]), [1.0, 0.0, 1.0])
    change(left, rig_from_camera=invert(body).tolist())
    change(right, rig_from_camera=invert(body @ invert(RIGHT_FROM_LEFT)).tolist())
    code, _, error = invoke(str(rig), "--rigid")
    assert code == 3
    assert "Camera right: rig_from_camera and the extrinsics put it" in error
    assert "correct or invert it" in error


@pytest.mark.parametrize("rigid", [True, False])
def test_what_is_found_is_told_of_every_camera(rig: Path, invoke: Invoke, rigid: bool) -> None:
    flags = ["--rigid"] if rigid else []
    code, out, err = invoke(str(rig), *flags, "--json", "-", "--output", "found")
    assert code == 0, err
    content = json.loads(out)
    assert content["verdict"] == "accepted" and content["rigid"] is rigid
    right = RIGHT_FROM_LEFT @ FOUND @ REFERENCE if rigid else FOUND @ RIGHT_FROM_LEFT @ REFERENCE
    assert_allclose(content["cameras"]["right"]["camera_from_lidar"], right, atol=1e-9)
    expected = adjoint(RIGHT_FROM_LEFT) @ COVARIANCE @ adjoint(RIGHT_FROM_LEFT).T if rigid else COVARIANCE
    assert_allclose(content["cameras"]["right"]["sigma"]["covariance"], expected, atol=1e-12)
    assert f"2 cameras, solved {'as one rigid rig' if rigid else 'one by one'}" in err
    assert_allclose(read_calibration(Path("found/right.yaml")).camera_from_lidar, right, atol=1e-9)


def test_a_disturbed_rig_is_held_against_what_it_was(rig: Path, invoke: Invoke) -> None:
    _, out, _ = invoke(str(rig), "--rigid", "--miscalibrate", "0,0,0,0,0,0")
    assert "left: accepted, corrected by 0.37°" in out and "off the reference by 0.37°" in out
    assert out.splitlines()[-1] == "Verdict: accepted (2 cameras, solved as one rigid rig)."


def test_the_worst_camera_decides(rig: Path, invoke: Invoke, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(RigCascade, "word", "rejected")
    code, out, _ = invoke(str(rig), "--output", "found")
    assert code == 0 and "left: rejected" in out and "Verdict: rejected" in out
    assert not Path("found/left.yaml").exists(), "what is rejected is not written"
    monkeypatch.setattr(RigCascade, "word", "cannot tell")
    code, out, _ = invoke(str(rig), "--rigid")
    assert code == 0 and "Verdict: cannot tell" in out


def test_a_tolerance_is_handed_on_and_told(rig: Path, invoke: Invoke) -> None:
    code, out, err = invoke(str(rig), "--tolerance", "0.5deg/2cm", "--json", "-")
    assert code == 0, err
    expected = np.diag([0.02**2] * 3 + [np.radians(0.5) ** 2] * 3)
    assert_allclose(LOADED.tolerance, expected)
    content = json.loads(out)
    assert content["rigid"] is False and content["tolerance"] == "0.5° / 2 cm"
    residual = content["cameras"]["left"]["residual"]
    assert residual["rotation_deg"] == pytest.approx(0.5) and residual["translation_cm"] == pytest.approx(5.0)
    assert residual["match_error_px"] == 1.5
    assert "left: accepted" in err and "0.50° / 5.0 cm from the result of its own frames" in err
    assert "as one rig, each ±0.5° / 2 cm (1σ) about its place on it" in err
    assert invoke(str(rig), "--tolerance", "2cm")[0] == 2
    assert invoke(str(rig), "--tolerance", "1deg/1cm", "--rigid")[0] == 2


def test_the_recording_of_a_rig_holds_what_was_found_and_every_camera_s_pictures(rig: Path, invoke: Invoke) -> None:
    assert invoke(str(rig), "--rigid", "--miscalibrate", "0,0,0,0,0,0", "--save", "rig.rrd", "--headless")[0] == 0
    assert is_rig(Path("rig.rrd"))
    recorded = read_rig(Path("rig.rrd"))
    assert recorded.title == "rig/my rig"
    assert [camera.name for camera in recorded.solved.cameras] == ["left", "right"]
    right = recorded.camera("right")
    assert_allclose(right.verdict.camera_from_lidar, RIGHT_FROM_LEFT @ FOUND @ REFERENCE, atol=1e-12)
    assert_allclose(right.initial, RIGHT_FROM_LEFT @ REFERENCE, atol=1e-12)
    assert right.reference is not None and right.camera.same(open_rig([rig])["right"]._lens.camera)
    assert right.residual.rotation_deg == pytest.approx(0.5)
    assert recorded.moments == {"left": (0, 1), "right": (0, 1)}
    pictures = recorded.pictures("right")
    assert pictures.image(1).startswith(b"\xff\xd8")
    before = pictures.overlay(entities.OVERLAY_MISCALIBRATED, 1)
    after = pictures.overlay(entities.OVERLAY_CORRECTED, 1)
    assert len(before.uv) > 100 and not np.array_equal(before.uv[:50], after.uv[:50])
    assert len(pictures.overlay(entities.OVERLAY_REFERENCE, 0).uv) > 100


def test_a_rig_is_exported_a_file_a_camera(rig: Path, invoke: Invoke) -> None:
    invoke(str(rig), "--rigid", "--save", "rig.rrd", "--headless")
    assert invoke("export", "rig.rrd", "--format", "yaml", "--output", "found")[0] == 0
    for name, relative in (("left", np.eye(4)), ("right", RIGHT_FROM_LEFT)):
        read = read_calibration(Path(f"found/{name}.yaml"))
        assert_allclose(read.camera_from_lidar, relative @ FOUND @ REFERENCE, atol=1e-9)
    code, out, _ = invoke("export", "rig.rrd", "--format", "ros", "--camera", "right")
    assert code == 0 and "camera_optical_frame" in out
    assert invoke("export", "rig.rrd", "--format", "ros", "--output", "ros")[0] == 0
    assert "right_camera_optical_frame" in Path("ros/right.yaml").read_text()
    code, _, err = invoke("export", "rig.rrd", "--format", "ros")
    assert code == 2 and "Give a folder with --output for all cameras, or one with --camera: left, right." in err
    assert (
        "has no camera 'up'; choose from left, right"
        in invoke("export", "rig.rrd", "--format", "ros", "--camera", "up")[2]
    )
    assert invoke("export", "rig.rrd", "--format", "ros", "--frame", "1", "--camera", "left")[0] == 2


def test_all_files_of_a_rig_are_of_one_run(rig: Path, invoke: Invoke) -> None:
    invoke(str(rig), "--rigid", "--save", "rig.rrd", "--headless")
    with locked(Path("found/right.yaml")):
        code, _, err = invoke("export", "rig.rrd", "--format", "yaml", "--output", "found")
    assert (code, [path.name for path in Path("found").glob("*.yaml")]) == (3, [])
    assert "right.yaml is being written by another run" in err


def test_every_camera_has_a_file_of_its_own_whatever_it_is_called(rig: Path, invoke: Invoke) -> None:
    names = ["front left", "front_left", os.fsdecode(b"caf\xe9")]
    (rig / "cameras" / "left").rename(rig / "cameras" / names[0])
    (rig / "cameras" / "right").rename(rig / "cameras" / names[1])
    shutil.copytree(rig / "cameras" / names[1], rig / "cameras" / names[2])
    code, _, err = invoke(str(rig), "--rigid", "--save", "rig.rrd", "--headless", "--output", "own")
    assert code == 0, err
    assert len(list(Path("own").iterdir())) == 3
    assert invoke("export", "rig.rrd", "--format", "ros", "--output", "found")[0] == 0
    written = [file.read_text() for file in Path("found").iterdir()]
    assert len(written) == 3
    frames = {re.findall(r"\w+_camera_optical_frame", text)[0] for text in written}
    assert len(frames) == 3


def test_a_rig_may_lie_in_a_folder_whose_name_is_not_utf_8(rig: Path, invoke: Invoke) -> None:
    foreign = rig.rename(rig.with_name(os.fsdecode(b"caf\xe9")))
    code, _, err = invoke(str(foreign), "--rigid", "--save", "rig.rrd", "--headless")
    assert code == 0, err
    assert len(read_rig(Path("rig.rrd")).solved.cameras) == 2


def test_what_is_rejected_of_a_rig_is_not_exported(rig: Path, invoke: Invoke, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(RigCascade, "word", "rejected")
    invoke(str(rig), "--rigid", "--save", "rig.rrd", "--headless")
    assert invoke("export", "rig.rrd", "--format", "yaml", "--output", "found")[0] == 1
    assert list(Path("found").iterdir()) == []


def test_the_report_of_a_rig_shows_all_its_cameras(rig: Path, invoke: Invoke) -> None:
    invoke(str(rig), "--rigid", "--save", "rig.rrd", "--headless")
    code, _, err = invoke("report", "rig.rrd", "--output", "page")
    assert code == 0, err
    page = Path("page/index.html").read_text()
    assert "2 cameras, solved as one rigid rig: corrected by " in page and "Accepted" in page
    for number, name in enumerate(("left", "right")):
        assert f"<b>{name}</b>" in page and f"<td>{name}</td>" in page
        for side in ("left", "right"):
            file = f"pictures/camera_{number}_{side}.jpg"
            assert file in page and Path("page", file).read_bytes().startswith(b"\xff\xd8")
    assert "$" not in page.replace("${", "").split("<script>")[0]
    assert json.loads(Path("page/metrics.json").read_text())["cameras"]["left"]["verdict"] == "accepted"
    assert Path("page/recording.rrd").stat().st_size == Path("rig.rrd").stat().st_size
