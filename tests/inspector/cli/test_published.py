"""The commands of published datasets: each opens what its arguments name, alone and below verify."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
import pytest

from calibnet.datasets.published import PUBLISHED
from inspector.cli import inspect as commands
from inspector.cli.errors import run
from inspector.cli.main import COMMANDS, cli
from inspector.cli.sources import SOURCES, open_parts
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
    (one,) = open_parts("kitti-360", tmp_path, ["0003"], "1")
    assert one.rig == "KITTI-360, camera 1"


def test_nuscenes(tmp_path: Path, opened: list[tuple[Any, dict[str, Any]]], capsys: pytest.CaptureFixture[str]) -> None:
    write_nuscenes(tmp_path)
    assert run(cli, ["nuscenes", "scene-0103", "--root", str(tmp_path), "--as-taken"]) == 0
    ((sequence, asked),) = opened
    assert (sequence.name, asked["camera"], sequence.notes) == ("nuscenes/scene-0103", "CAM_FRONT", ())
    assert run(cli, ["nuscenes", "--root", str(tmp_path), "--camera", "CAM_BACK"]) == 3
    assert "no keyframe of CAM_BACK" in capsys.readouterr().err
    assert run(cli, ["nuscenes"]) == 3
    assert "add --root DIR or set NUSCENES" in capsys.readouterr().err
    assert [one.name for one in open_parts("nuscenes", tmp_path, ["103"], None)] == ["nuscenes/scene-0103"]


@pytest.mark.parametrize("group", ["verify", "watch", "live"])
@pytest.mark.parametrize("command", ["kitti360", "nuscenes"])
def test_they_can_be_verified_and_watched(group: str, command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(cli, [group, command, "--help"]) == 0
    assert "--root" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("dataset", "text", "options"),
    [
        ("kitti-raw", "2011_09_26/0005", {"date": "2011_09_26", "drive": "0005"}),
        ("kitti-tracking", "0004", {"sequence": "0004"}),
        ("nuscenes", "scene-0061/CAM_BACK", {"scene": "scene-0061", "camera": "CAM_BACK"}),
    ],
)
def test_a_sequence_is_named_by_its_parts(dataset: str, text: str, options: dict[str, str]) -> None:
    assert PUBLISHED[dataset].named(text) == options


@pytest.mark.parametrize(
    ("dataset", "text"), [("kitti-raw", "0005"), ("kitti-raw", "2011_09_26/"), ("nuscenes", "a/b/c")]
)
def test_another_name_says_what_one_looks_like(tmp_path: Path, dataset: str, text: str) -> None:
    example = PUBLISHED[dataset].example
    with pytest.raises(click.UsageError, match=f"is not [A-Z/]+; give for instance {example}"):
        open_parts(dataset, tmp_path, [text], None)


def test_every_kind_of_data_is_a_command_of_its_own_and_below_the_others() -> None:
    names = {source.name for source in SOURCES}
    assert names <= COMMANDS.keys()
    for group in ("verify", "watch", "live"):
        command = COMMANDS[group].load()
        assert isinstance(command, click.Group)
        assert names - command.commands.keys() == ({"object"} if group == "watch" else set())
