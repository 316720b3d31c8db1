"""A recording made by version 0.1.0, before its code was rearranged, still serves every reader."""

from __future__ import annotations

import json
import lzma
from pathlib import Path

import pytest
from click.testing import CliRunner

from inspector.cli.main import cli
from inspector.read.run import read_run
from inspector.read.verdict import inferred_verdict

KEPT = Path(__file__).parents[1] / "data" / "recording-of-version-0.1.0.rrd.xz"
"""Two frames of the fake car (`tests.support.fakes`), 5/0.5, seed 1, its drive solved as 2 cm off to the right."""


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("kept") / "kept.rrd"
    file.write_bytes(lzma.decompress(KEPT.read_bytes()))
    return file


def test_its_frames_are_read(recording: Path) -> None:
    run = read_run(recording)
    assert len(run.frames) == 2 and not run.warning
    assert [frame.index for frame in run.frames] == [0, 1]
    errors = [frame.error(frame.corrected) for frame in run.frames]
    assert all(error is not None and error.rotation_deg < 1 for error in errors)


def test_its_frames_are_judged_by_what_was_applied(recording: Path) -> None:
    run = read_run(recording)
    assert [frame.verdict.word for frame in run.frames] == ["accepted", "accepted"]
    assert run.frames[0].verdict.reason == "Image and scan fit together."
    assert run.drive is not None and run.drive_verdict is None
    frame = run.frames[0]
    left = inferred_verdict(frame.initial, frame.initial, frame.stages)
    assert left.word == "rejected"


def test_check_passes_and_fails(recording: Path) -> None:
    passed = CliRunner().invoke(cli, ["check", str(recording), "--max-rotation", "1"])
    assert "Passed: median rotation error 0.1" in passed.output
    failed = CliRunner().invoke(cli, ["check", str(recording), "--max-rotation", "0.1"], standalone_mode=False)
    assert "Failed" in failed.output or failed.return_value == 1


def test_export_gives_the_drive_s_extrinsic(recording: Path) -> None:
    result = CliRunner().invoke(cli, ["export", str(recording), "--format", "json", "--drive"])
    exported = json.loads(result.output)
    assert exported["translation_m"] == pytest.approx([0.08, -0.08, -0.27], abs=1e-9)
    assert (exported["image_width"], exported["image_height"]) == (400, 120)


def test_report_and_compare_open_it(recording: Path, tmp_path: Path) -> None:
    CliRunner().invoke(cli, ["report", str(recording), "--output", str(tmp_path / "report")])
    assert "fake" in (tmp_path / "report" / "index.html").read_text(encoding="utf-8")
    saved = tmp_path / "both.rrd"
    twice = [str(recording), str(recording), "--names", "a,b", "--headless", "--save", str(saved)]
    result = CliRunner().invoke(cli, ["compare", *twice])
    assert "cm off as one drive; 0.16° / 1.4 cm off, median over 2 frames." in result.output
    assert saved.stat().st_size > 10_000
