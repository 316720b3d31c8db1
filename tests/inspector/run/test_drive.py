"""A drive's answer: recorded over every frame, and first in everything that is said of the run."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibnet.errors import CalibrationError
from calibnet.geometry import pose_error
from inspector import entities
from inspector.check import Limit, check_run
from inspector.cli.errors import run
from inspector.cli.main import cli
from inspector.compare.blueprint import results_tab
from inspector.compare.comparison import Comparison
from inspector.compare.table import comparison_table
from inspector.read.run import RecordedRun, read_run
from inspector.read.understood import RecordingError
from inspector.report.metrics import Figures
from inspector.report.verdict import headline
from inspector.report.write import write_report
from tests.support.fakes import FakeCascade
from tests.support.layout import views

Read = Callable[..., list[tuple[Any, Any]]]


@pytest.fixture(scope="module")
def file(record: Callable[..., Any], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three frames whose drive ends a tenth of a degree off."""
    file = tmp_path_factory.mktemp("drive") / "drive.rrd"
    record(file, detail="overview", strides=(32,), drive=True)
    return file


@pytest.fixture
def recorded(file: Path) -> RecordedRun:
    return read_run(file)


def text_of(file: Path) -> str:
    return said_last(file, entities.DRIVE_TEXT, "TextDocument:text")


def said_last(file: Path, entity: str, component: str) -> str:
    """What holds at all times."""
    from rerun.chunk import RrdReader

    *_, last = RrdReader(file).store().stream().filter(content=f"/{entity}", components=component)
    text: str = last.to_record_batch()[component].to_pylist()[0][0]
    return text


def test_every_frame_has_its_points_under_the_drives_extrinsic(file: Path, read: Read) -> None:
    shown = read(file, entities.OVERLAY_DRIVE, "Points2D:positions")
    assert [frame for frame, _ in shown] == [0, 1, 2]
    captions = [row.as_py()[0] for _, row in read(file, entities.caption(entities.OVERLAY_DRIVE), "text")]
    assert captions == ["whole drive as one: 0.10°, 0.0 cm off"] * 3


def test_on_steps_the_picture_walks_to_the_drives_result(file: Path, read: Read) -> None:
    caption = entities.caption(entities.OVERLAY_CURRENT)  # of the rows at a time viewers show the last
    said = {step: row.as_py()[0] for step, row in read(file, caption, "text", entities.STEP)}
    for frame in range(3):
        first = entities.STEPS_PER_FRAME * frame
        assert said[first].startswith("miscalibrated: ")
        assert said[first + entities.STEP_REFERENCE] == "reference"
        assert said[first + entities.STEP_RESULT] == "whole drive as one: 0.10°, 0.0 cm off"
    on_frames = {frame: row.as_py()[0] for frame, row in read(file, caption, "text")}
    assert on_frames == dict.fromkeys(range(3), "whole drive as one: 0.10°, 0.0 cm off")


def test_the_answer_has_the_matrix_and_the_frames_beside_it(file: Path, recorded: RecordedRun) -> None:
    text = text_of(file)
    assert "**Off the reference by 0.10° / 0.0 cm**, solved from 3 frames." in text
    assert "Error, median over frames: " in text and "Worst: frame " in text
    assert recorded.drive is not None
    assert " ".join(f"{value:9.5f}" for value in recorded.drive[0]) in text


def test_a_report_shows_the_drives_result_and_beside_it_each_frames_own(recorded: RecordedRun, tmp_path: Path) -> None:
    page = write_report(recorded, tmp_path / "report").read_text(encoding="utf-8")
    assert "0.10° / 0.0\u00a0cm whole drive as one; " in page and "Whole drive as one against" in page
    shown = {file.name: file.read_bytes() for file in (tmp_path / "report" / "pictures").iterdir()}
    assert shown["worst_whole-drive-as-one.jpg"] != shown["worst_this-frame-alone.jpg"]
    assert "worst_corrected.jpg" not in shown


def test_report_and_metrics_begin_with_it(recorded: RecordedRun) -> None:
    figures = Figures.of(recorded)
    plain = headline(figures).replace("\u00a0", " ")
    assert plain.startswith("Corrected fake/00 from ") and "to 0.10° / 0.05 cm, 3 frames as one; one by one" in plain
    content = figures.as_dict()
    assert content["drive_extrinsic_error"]["rotation_deg"] == pytest.approx(0.1, abs=1e-6)
    np.testing.assert_array_equal(content["drive_extrinsic"], recorded.drive)


def test_export_takes_it_unless_something_else_is_named(
    file: Path, recorded: RecordedRun, capsys: pytest.CaptureFixture[str]
) -> None:
    found = {}
    for choice in ((), ("--drive",), ("--median",), ("--frame", "1")):
        assert run(cli, ["export", str(file), "--format", "json", *choice]) == 0
        found[choice] = np.array(json.loads(capsys.readouterr().out)["camera_from_lidar"])
    np.testing.assert_array_equal(found[()], recorded.drive)
    np.testing.assert_array_equal(found[("--drive",)], recorded.drive)
    np.testing.assert_array_equal(found[("--frame", "1")], recorded.frames[1].corrected)
    assert pose_error(found[("--median",)], found[()]).rotation_deg > 1e-3


def test_check_holds_it_or_the_worst_frame_against_limits(recorded: RecordedRun, full_recording: Path) -> None:
    (of_drive,) = check_run(recorded, [Limit("rotation", 0.2, "drive")])
    assert of_drive.value == pytest.approx(0.1, abs=1e-6)
    assert of_drive.sentence == "the drive's rotation error 0.1° (allowed 0.2°)"
    errors = [error.translation_cm for frame in recorded.frames if (error := frame.error(frame.corrected)) is not None]
    (largest,) = check_run(recorded, [Limit("translation", 0.0, "max")])
    assert largest.value == max(errors) and not largest.passed
    with pytest.raises(RecordingError, match="no estimate from the whole drive"):
        check_run(read_run(full_recording), [Limit("rotation", 1.0, "drive")])


def test_a_comparison_leads_with_the_drives(
    file: Path,
    record: Callable[..., Any],
    read: Read,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    record(tmp_path / "alone.rrd", detail="overview", strides=(32,), drive=False)
    together = tmp_path / "both.rrd"
    assert run(cli, ["compare", str(file), str(tmp_path / "alone.rrd"), "--save", str(together), "--headless"]) == 0
    drive, alone = capsys.readouterr().out.splitlines()[:2]
    assert drive.startswith("drive: 0.10° / 0.0 cm off as one drive; ") and drive.endswith("median over 3 frames.")
    assert alone.startswith("alone: 0.16° / 1.4 cm off, median")
    comparison = Comparison.of([read_run(file), read_run(tmp_path / "alone.rrd")], ["drive", "alone"])
    first = comparison_table(comparison).split("###")[1]
    assert first.startswith(" Whole drive as one")
    assert "| **drive** | – | 0.10° / 0.0 cm | – | – |" in first and "| **alone** | not solved | – | – | – |" in first
    answers = [view.name for view in views(results_tab(comparison))][:2]
    assert answers == ["drive: whole drive as one", "alone: each frame alone"]
    (level,) = {row.as_py()[0] for _, row in read(together, "drive/error/rotation/drive", "Scalars:scalars")}
    assert level == pytest.approx(0.1, abs=1e-6)
    assert len(read(together, f"drive/{entities.OVERLAY_DRIVE}", "Points2D:positions")) == 3


def test_frames_of_several_mounts_are_no_drive(record: Callable[..., Any], tmp_path: Path) -> None:
    file = tmp_path / "mounts.rrd"
    summary = record(file, detail="overview", strides=(32,), drive=True, per_frame=True)
    assert summary.drive == "The frames come from several mounts: the whole drive is not solved as one."
    assert summary.drive in summary.lines() and summary.drive in text_of(file)
    assert read_run(file).drive is None


def test_a_drive_that_cannot_be_solved_loses_nothing_unless_it_was_asked_for(
    record: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: Any) -> None:
        raise CalibrationError("No frame could be calibrated.")

    monkeypatch.setattr(FakeCascade, "calibrate_drive", fail)
    summary = record(tmp_path / "a.rrd", detail="overview", strides=(32,), drive=True)
    assert summary.drive.startswith("No frame could be calibrated: ")
    assert len(read_run(tmp_path / "a.rrd").frames) == 3
    with pytest.raises(CalibrationError, match="No frame could be calibrated"):
        record(tmp_path / "b.rrd", detail="overview", strides=(32,), drive=True, drive_asked=True)


def test_speed_is_that_of_the_frames_alone(record: Callable[..., Any], tmp_path: Path) -> None:
    summary = record(tmp_path / "a.rrd", detail="overview", strides=(32,), drive=True)
    assert summary.ended is not None
    took = summary.ended - summary.started
    assert summary.lines()[0] == f"3 frames in {took:.1f} s, {3 / took:.1f} frames/s."


def test_frames_that_became_worse_are_counted(record: Callable[..., Any], tmp_path: Path) -> None:
    class Worse(FakeCascade):
        def calibrate(self, frame: Any, initial: Any, detail: bool = True) -> Any:
            trace = super().calibrate(frame, initial, detail)
            if frame.index != 1:
                return trace
            away = np.eye(4)
            away[0, 3] = 3.0
            moved = replace(trace.stages[-1], after=away @ trace.initial)
            return replace(trace, stages=(*trace.stages[:-1], moved))

    summary = record(tmp_path / "w.rrd", cascade_type=Worse, detail="overview", strides=(32,))
    told = summary.of_frames()
    assert told[1].startswith("Worst: frame 1, ")
    caption = said_last(tmp_path / "w.rrd", entities.caption(entities.OVERLAY_WORST), "text")
    assert caption.startswith("frame 1, worse than before"), "the tab of the worst frame shows it at all times"
    assert told[2] == "1 of 3 frames got worse in rotation or translation: 1."


def test_the_end_of_a_run_has_what_was_found_as_a_matrix(record: Callable[..., Any], tmp_path: Path) -> None:
    of_drive = record(tmp_path / "a.rrd", detail="overview", strides=(32,), drive=True).matrix_lines()
    assert of_drive[0] == "camera_from_lidar (metres), the whole drive as one:"
    drive = read_run(tmp_path / "a.rrd").drive
    assert drive is not None
    np.testing.assert_allclose([[float(value) for value in row.split()] for row in of_drive[1:]], drive[:3], atol=1e-5)
    one = record(tmp_path / "b.rrd", length=1, detail="overview", strides=(32,)).matrix_lines()
    assert one[0] == "camera_from_lidar (metres), of this frame:"
    several = record(tmp_path / "c.rrd", detail="overview", strides=(32,))
    rejected = record(tmp_path / "d.rrd", length=1, detail="overview", strides=(32,), doubted=(0,))
    assert several.matrix_lines() == rejected.matrix_lines() == []
