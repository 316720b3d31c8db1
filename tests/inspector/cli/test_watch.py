"""``calib-inspect watch``: sentences, JSON, exit codes and the recording."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rerun.chunk import RrdReader

from calibnet.drive import watching
from calibnet.drive.changes import watch
from calibnet.verdict import BadFrame
from calibnet.watch import Watched
from inspector.cli.errors import run
from inspector.cli.main import cli
from tests.calibnet.drive.test_changes import YAW, looks, moved, noise
from tests.support.fakes import REFERENCE, FakeCascade
from tests.support.folder import write_folder

STEP = Watched(REFERENCE, watch(looks(moved(noise(100), 50, YAW))), "", 100, (BadFrame(7, "It is cut short."),))
DRIFT = Watched(REFERENCE, watch(looks(noise(300) + np.linspace(0, 1, 300)[:, None] * 2 * YAW)), "", 300)
STILL = Watched(REFERENCE, watch(looks(noise(100))), "", 100)
BLIND = Watched(None, None, "12 frames are too few to detect a change; 16 are needed.", 0)


@pytest.fixture
def own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    from calibnet.cascade import cascade as module

    monkeypatch.setattr(module.Cascade, "load", staticmethod(lambda *_, **__: FakeCascade()))
    return write_folder(tmp_path / "own", 3)


@pytest.mark.parametrize(
    ("watched", "code", "said"),
    [
        (STEP, 1, ["Frame 50: the mount moved by 0.5", "Changed: the mount moved once (100 frames, 1 skipped)."]),
        (DRIFT, 1, ["Frames 0 to 299: the mount drifts by 1.", "Changed: the mount moved once (300 frames)."]),
        (STILL, 0, ["No change (100 frames). A step of 0."]),
        (BLIND, 4, ["Cannot tell. 12 frames are too few to detect a change; 16 are needed."]),
    ],
    ids=["step", "drift", "still", "blind"],
)
def test_what_was_found_is_said_and_is_the_exit_code(
    own: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    watched: Watched,
    code: int,
    said: list[str],
) -> None:
    monkeypatch.setattr(watching, "watch_drive", lambda *_: watched)
    assert run(cli, ["watch", "folder", str(own)]) == code
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == len(said)
    assert all(line.startswith(start) for line, start in zip(lines, said, strict=True)), lines


def test_json_and_recording_hold_the_estimate_over_the_drive(
    own: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    read: Callable[..., list[tuple[Any, Any]]],
) -> None:
    monkeypatch.setattr(watching, "watch_drive", lambda *_: STEP)
    file = tmp_path / "watch.rrd"
    assert run(cli, ["watch", "folder", str(own), "--json", "-", "--save", str(file)]) == 1
    printed = capsys.readouterr()
    assert f"Saved {file} (" in printed.err
    content = json.loads(printed.out)
    (change,) = content["changes"]
    assert content["result"] == "changed" and abs(change["frame"] - 50) <= 2 and change["confidence"] > 0.999
    assert change["rotation_deg"] == pytest.approx(0.5, abs=0.15)
    assert change["offset"]["yaw"] == pytest.approx(0.5, abs=0.15)
    assert [window["frame"] for window in content["windows"]] == list(range(100))
    assert content["windows"][90]["estimate"]["yaw"] - content["windows"][5]["estimate"]["yaw"] == pytest.approx(
        0.5, abs=0.25
    )
    assert content["frames"] == {"used": 100, "skipped": [{"frame": 7, "why": "It is cut short."}]}
    estimate = read(file, "watch/yaw/estimate", "Scalars:scalars")
    assert len(estimate) == 100 and len(read(file, "watch/yaw/change", "Scalars:scalars")) == 1


def test_a_run_has_a_tab_that_says_so_of_its_drive(
    record: Callable[..., Any], tmp_path: Path, read: Callable[..., list[tuple[Any, Any]]]
) -> None:
    file = tmp_path / "run.rrd"
    record(file, length=3, detail="overview", strides=(32,), drive=True, watching=lambda _: STEP)
    *_, text = RrdReader(file).store().stream().filter(content="/watch/result")
    assert text.to_record_batch()["TextDocument:text"].to_pylist()[-1][0].startswith("# Changed: the mount moved once")
    ((frame, moved),) = read(file, "watch/yaw/change", "Scalars:scalars")
    assert abs(frame - 50) <= 2 and moved.as_py()
    record(tmp_path / "short.rrd", length=3, detail="overview", strides=(32,), drive=True)
    assert list(RrdReader(tmp_path / "short.rrd").store().stream().filter(content="/watch/result")) == []


def test_watch_has_no_option_that_it_would_refuse_or_ignore(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(cli, ["watch", "folder", "--help"]) == 0
    shown = capsys.readouterr().out
    for option in ("--per-frame", "--method", "--no-drive", "--headless", "--report", "--log"):
        assert option not in shown
    assert "[default: none, start from the calibration as it is]" in " ".join(shown.split())


def test_frames_of_several_mounts_cannot_be_watched(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(cli, ["watch", "object"]) == 2
    assert "No such command 'object'" in capsys.readouterr().err


def test_a_drive_of_three_frames_cannot_be_told(own: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(cli, ["watch", "folder", str(own)]) == 4
    assert "3 frames are too few" in capsys.readouterr().out
