"""The commands of published datasets: each opens what its arguments name, alone and below verify."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from inspector.cli import inspect as commands
from inspector.cli.errors import run
from inspector.cli.evaluate import open_sequences
from inspector.cli.main import cli
from tests.calibnet.datasets.published import write_kitti_360, write_nuscenes


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[tuple[Any, dict[str, Any]]]:
    """What the commands would calibrate, with the options."""
    calls: list[tuple[Any, dict[str, Any]]] = []

    def calibrate(sequence: Any, **asked: Any) -> int:
        calls.append((sequence, asked))
        return 0

    monkeypatch.setattr(commands, "calibrate", calibrate)
    return calls


def test_kitti_360(tmp_path: Path, opened: list[tuple[Any, dict[str, Any]]]) -> None:
    write_kitti_360(tmp_path)
    assert run(cli, ["kitti360", "3", "--root", str(tmp_path), "--camera", "1", "--no-drive"]) == 0
    ((sequence, asked),) = opened
    assert (sequence.name, asked["camera"], asked["drive"]) == ("kitti-360/0003", 1, False)
    (one,) = open_sequences("kitti-360", tmp_path, ["0003"], 1)
    assert one.rig == "KITTI-360, camera 1"


def test_nuscenes(tmp_path: Path, opened: list[tuple[Any, dict[str, Any]]], capsys: pytest.CaptureFixture[str]) -> None:
    write_nuscenes(tmp_path)
    assert run(cli, ["nuscenes", "scene-0103", "--root", str(tmp_path), "--as-taken"]) == 0
    ((sequence, asked),) = opened
    assert (sequence.name, asked["camera"], sequence.notes) == ("nuscenes/scene-0103", "CAM_FRONT", ())
    assert run(cli, ["nuscenes", "--root", str(tmp_path), "--camera", "CAM_BACK"]) == 3
    assert "no keyframe of CAM_BACK" in capsys.readouterr().err
    assert run(cli, ["nuscenes"]) == 3
    assert "give --root DIR or set NUSCENES" in capsys.readouterr().err
    assert [one.name for one in open_sequences("nuscenes", tmp_path, ["103"], None)] == ["nuscenes/scene-0103"]


@pytest.mark.parametrize("group", ["verify", "watch"])
@pytest.mark.parametrize("command", ["kitti360", "nuscenes"])
def test_they_can_be_verified_and_watched(group: str, command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(cli, [group, command, "--help"]) == 0
    assert "--root" in capsys.readouterr().out
