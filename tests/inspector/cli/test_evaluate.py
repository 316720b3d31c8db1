"""The command from its options to its JSON, with a cascade whose answers are known."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
import yaml

from calibnet.datasets import Frame, Sequence
from calibnet.geometry import RANGES, invert, miscalibration
from calibnet.geometry.types import Transform
from calibnet.trace import CascadeTrace, DriveEstimate, Estimate, StageTrace
from calibnet.verdict import Cause, Verdict
from inspector.cli.errors import run
from inspector.cli.main import cli

CAMERA_FROM_LIDAR = [[0.0, -1.0, 0.0, 0.1], [0.0, 0.0, -1.0, -0.2], [1.0, 0.0, 0.0, -0.3], [0.0, 0.0, 0.0, 1.0]]


class KnownCascade:
    """Every stage that was asked for ends 1 degree of yaw beside the reference."""

    loaded: dict[str, Any]
    skipped = (SimpleNamespace(reason="Stage 1 has no weights."),)
    unjudged = "The verdict was fitted to other weights."

    @classmethod
    def load(
        cls, preset: str, stages: tuple[int, ...] | None = None, folder: Path | None = None, wider: bool = False
    ) -> KnownCascade:
        cascade = cls()
        cls.loaded = {"preset": preset, "stages": stages}
        return cascade

    def calibrate(self, frame: Frame, initial: Transform, detail: bool = False) -> CascadeTrace:
        after = miscalibration([0, 0, 1.0], [0, 0, 0]) @ frame.camera_from_lidar
        stages = [
            StageTrace(number, RANGES[number - 1], frame.camera, initial, after, after @ invert(initial))
            for number in self.loaded["stages"]
        ]
        return CascadeTrace(initial, tuple(stages))

    def explain(self, frame: Frame, initial: Transform, lags: object = None) -> Verdict:
        """Rejects everything, and takes everything for a mirrored image."""
        mirrored = Cause("mirrored", "The image is mirrored.", "so a test wants it")
        return Verdict("rejected", "It does not fit.", self.calibrate(frame, initial).arrived, causes=(mirrored,))

    def calibrate_drive(
        self, frames: Sequence, initial: Transform, observer: Callable[[int, int], None] | None = None
    ) -> DriveEstimate:
        networks = Estimate(miscalibration([0, 0.5, 0], [0, 0, 0]) @ CAMERA_FROM_LIDAR, np.eye(6), len(frames))
        found = miscalibration([0, 0.25, 0], [0, 0, 0]) @ CAMERA_FROM_LIDAR
        return DriveEstimate(found, np.eye(6), len(frames), networks=networks)


@pytest.fixture(autouse=True)
def known_cascade(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("calibnet.cascade.cascade.Cascade", KnownCascade)


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    """A folder dataset of three tiny frames."""
    folder = tmp_path / "rig"
    (folder / "images").mkdir(parents=True)
    (folder / "clouds").mkdir()
    generator = np.random.default_rng(0)
    for number in range(3):
        cv2.imwrite(str(folder / "images" / f"{number:04d}.png"), generator.integers(0, 255, (48, 96, 3), np.uint8))
        points = generator.uniform([2, -5, -1, 0], [30, 5, 2, 1], (200, 4)).astype(np.float32)
        points.tofile(folder / "clouds" / f"{number:04d}.bin")
    calibration = {
        "width": 96,
        "height": 48,
        "camera_matrix": [[80.0, 0.0, 47.5], [0.0, 80.0, 23.5], [0.0, 0.0, 1.0]],
        "distortion": [0.0] * 5,
        "camera_from_lidar": CAMERA_FROM_LIDAR,
    }
    (folder / "calibration.yaml").write_text(yaml.safe_dump(calibration))
    return folder


def test_folder_to_table_and_json(rig: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "new" / "out.json"
    arguments = ["--dataset", "folder", "--root", str(rig.parent), "--sequences", "rig", "--range", "5/0.5"]
    assert run(cli, ["evaluate", *arguments, "--repeats", "2", "--seed", "3", "--json", str(out)]) == 0
    content = json.loads(out.read_text())
    assert (content["frames"], content["repeats"], content["seed"]) == (3, 2, 3)
    assert content["initial"]["rotation_deg"]["mean"] > 1.5
    assert [stage["range"] for stage in content["stages"]] == ["5/0.5", "2/0.2", "1/0.1"]
    assert content["stages"][0]["rotation_deg"]["yaw"] == pytest.approx(1.0)
    assert content["sequence"]["rotation_deg"]["pitch"] == pytest.approx(0.25)
    assert content["sequence_networks"]["rotation_deg"]["pitch"] == pytest.approx(0.5)
    assert content["references"]["no correction"] == content["initial"]
    assert set(content["references"]) == {"no correction", "edge alignment"}
    assert "audit" not in content
    assert KnownCascade.loaded == {"preset": "compact", "stages": (3, 4, 5)}
    printed, said = capsys.readouterr()
    assert "Stage 1 has no weights." in said
    rows = [line.split()[:2] for line in printed.splitlines() if line.strip().startswith(("initial", "stage"))]
    assert [row[0] for row in rows[:4]] == ["initial", "stage", "stage", "stage"]
    assert "edge alignment" in printed
    of_drives = [line.split() for line in printed.splitlines() if line.strip().startswith("drive")]
    assert of_drives[0][:3] == ["drive,", "networks", "0.500"] and of_drives[1][:2] == ["drive", "0.250"]
    assert "100.0%" in printed  # within 2 degrees and 5 cm
    assert max(len(line) for line in printed.splitlines()[1:]) <= 80
    assert list(tmp_path.glob("new/*")) == [out]


def test_audit_and_names_after_the_option(rig: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shutil.copytree(rig, rig.parent / "other")
    out = tmp_path / "audit.json"
    where = ["--dataset", "folder", "--root", str(rig.parent), "--sequences", "rig,other"]
    assert run(cli, ["evaluate", *where, "--audit", "--no-classical", "--no-drives", "--json", str(out)]) == 0
    content = json.loads(out.read_text())
    assert [Path(name).name for name in content["sequences"]] == ["rig", "other"] and content["frames"] == 6
    assert set(content["audit"]) == {"swapped", "grey", "thinned"} and content["sequence"] is None
    assert content["audit"]["grey"]["rotation_deg"]["yaw"] == pytest.approx(1.0)
    assert {Path(name).name for name in content["audit_images"].split(", ")} == {"rig", "other"}
    assert "with a grey image" in " ".join(capsys.readouterr().out.split())


def test_same_seed_same_figures_whatever_the_frames(rig: Path, tmp_path: Path) -> None:
    contents = []
    for name in ("a.json", "b.json"):
        arguments = ["--dataset", "folder", "--root", str(rig), "--seed", "5", "--json", str(tmp_path / name)]
        assert run(cli, ["evaluate", *arguments]) == 0
        contents.append((tmp_path / name).read_bytes())
    assert contents[0] == contents[1]


def test_json_on_stdout_is_nothing_but_json(rig: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["--dataset", "folder", "--root", str(rig), "--frames", "1:", "--stages", "3,5", "--json", "-"]
    assert run(cli, ["evaluate", *arguments]) == 0
    printed = capsys.readouterr()
    content = json.loads(printed.out)
    assert content["frames"] == 2
    assert [stage["number"] for stage in content["stages"]] == [3, 5]
    assert "Rotation error" in printed.err


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["--dataset", "folder", "--root", "ROOT/none"], 3, "none"),
        (["--dataset", "kitti-odometry", "--root", "ROOT"], 2, "--sequences is needed"),
        (["--dataset", "kitti-raw", "--root", "ROOT", "--sequences", "0005"], 2, "not DATE/DRIVE"),
        (["--dataset", "kitti-odometry", "--root", "ROOT", "--sequences", "04"], 3, "sequences"),
        (["--dataset", "folder", "--root", "ROOT/rig", "--frames", "10"], 3, "10"),
        (["--dataset", "folder", "--root", "ROOT/rig", "--camera", "2"], 3, "camera"),
        (["--dataset", "nonsense", "--root", "ROOT"], 2, "nonsense"),
        (["--dataset", "folder", "--root", "ROOT/rig", "--repeats", "0"], 2, "repeats"),
        (["--dataset", "folder", "--root", "ROOT/rig", "--json", "ROOT/rig/calibration.yaml/x.json"], 3, "calibration"),
    ],
)
def test_bad_input_is_one_message(
    arguments: list[str], code: int, message: str, rig: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = [argument.replace("ROOT", str(rig.parent)) for argument in arguments]
    assert run(cli, ["evaluate", *arguments]) == code
    printed = capsys.readouterr()
    assert message in printed.err
    assert "Traceback" not in printed.err
    assert printed.out == ""


def test_the_battery_is_a_table_and_its_json_the_object_of_its_rows(rig: Path, tmp_path: Path) -> None:
    file = tmp_path / "battery.json"
    arguments = ["--dataset", "folder", "--root", str(rig), "--range", "5/0.5", "--frames", "0:2", "--battery"]
    code = run(cli, ["evaluate", *arguments, "--json", str(file)])
    content = json.loads(file.read_text())
    assert code == 0 and content.keys() == {"rows", "false_accept_rate", "false_claim_rate", "acceptance_of_good"}
    rows = {(row["corruption"], row["strength"]): row for row in content["rows"]}
    assert {"none", "mirrored", "focal-length", "late-scan", "units"} <= {name for name, _ in rows}
    assert rows["mirrored", ""]["runs"] == rows["mirrored", ""]["rejected"] == rows["mirrored", ""]["cause_right"] == 2
    assert rows["none", ""]["cause_right"] == 0 and rows["late-scan", "+1"]["runs"] == 1
    assert content["false_accept_rate"] == 0.0


def test_weights_of_another_method_lie_in_a_folder_of_their_own(
    rig: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    own = tmp_path / "methods"
    own.mkdir()
    arguments = ["--dataset", "folder", "--root", str(rig), "--range", "5/0.5", "--method", "lccnet"]
    assert run(cli, ["evaluate", *arguments, "--method-weights", str(own)]) == 3
    said = " ".join(capsys.readouterr().err.split())
    assert f"{own}" in said and "lccnet" in said and KnownCascade.loaded["preset"] == "compact"
