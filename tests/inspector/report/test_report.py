"""The report of a fake recording: its figures, its sentences, and what it leaves alone."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import cv2
import numpy as np
import pytest

from calibnet.errors import CalibnetError
from calibnet.verdict import CANNOT_TELL, REJECTED, BadFrame, Verdict
from inspector.cli.errors import run
from inspector.cli.main import cli
from inspector.read.run import RecordedRun, read_run
from inspector.report.metrics import Figures, misplacement_cm
from inspector.report.pictures import PICTURE_WIDTH, draw_overlay
from inspector.report.verdict import findings, headline, verdict
from inspector.report.write import write_report
from tests.support.browser import chromium


@pytest.fixture(scope="module")
def known(record: Callable[..., Any], tmp_path_factory: pytest.TempPathFactory) -> RecordedRun:
    """Five frames, each miscalibrated in its own way: the fake stages leave 0.3, 0.09 and 0.027 of the error."""
    file = tmp_path_factory.mktemp("known") / "known.rrd"
    record(file, length=5, detail="overview", per_frame=True)
    return read_run(file)


@pytest.fixture(scope="module")
def unknown(record: Callable[..., Any], tmp_path_factory: pytest.TempPathFactory) -> RecordedRun:
    """The same without a reference; the start is what the fake cascade moves to, so nothing changes."""
    file = tmp_path_factory.mktemp("unknown") / "unknown.rrd"
    record(file, length=3, detail="overview", as_is=True)
    return read_run(file)


def moved(run: RecordedRun, offsets_m: list[float]) -> RecordedRun:
    """Each frame's result moved sideways by its offset."""
    frames = []
    for frame, offset in zip(run.frames, offsets_m, strict=True):
        after = frame.initial.copy()
        after[0, 3] += offset
        frames.append(replace(frame, corrected=after, stages=dict.fromkeys(frame.stages, after)))
    return replace(run, frames=tuple(frames))


def page_of(run: RecordedRun, folder: Path) -> str:
    return write_report(run, folder).read_text(encoding="utf-8")


def test_rejected_frames_are_told(record: Callable[..., Any], tmp_path: Path) -> None:
    for doubted in ((1,), (0, 1, 2)):
        record(tmp_path / "run.rrd", detail="overview", strides=(32,), doubted=doubted)
        figures = Figures.of(read_run(tmp_path / "run.rrd"))
        assert figures.rejected == figures.as_dict()["verdicts"]["rejected"] == len(doubted)
        content = figures.as_dict()
        assert content["verdicts"] == {"accepted": 3 - len(doubted), "rejected": len(doubted), "cannot_tell": 0}
        assert content["verdict_of_drive"] is None
        told = [frame["verdict"]["verdict"] for frame in content["per_frame"]]
        assert told == ["rejected" if index in doubted else "accepted" for index in range(3)]
        assert figures.corrected.errors[1] == figures.initial.errors[1]
        first = findings(figures)[0]
        assert first.grade == "bad" and "rejected" in first.sentence
        assert ("nothing was corrected" in first.sentence) == (len(doubted) == 3)
        (reason,) = verdict(figures.run)
        assert reason.grade == ("good" if len(doubted) == 1 else "bad") and "do not fit together" in reason.sentence
        page = page_of(figures.run, tmp_path / str(len(doubted)))
        word = "Accepted" if len(doubted) == 1 else "Rejected"
        assert f'<p class="word {reason.grade}">{word}</p>' in page


def test_the_page_of_a_verification_is_headed_by_what_is_judged(known: RecordedRun, tmp_path: Path) -> None:
    given = Verdict("rejected", "It is off; run without `verify` & look.", np.eye(4), (1.0, 20.0))
    page = page_of(replace(known, given_verdict=given), tmp_path)
    assert '<p class="word bad">Calibration as given: rejected</p>' in page
    assert '<li class="bad">It is off; run without <code>verify</code> &amp; look.</li>' in page


def test_the_drive_leads_where_it_is_believed(known: RecordedRun) -> None:
    reference = known.frames[0].reference
    assert reference is not None
    drive = reference.copy()
    drive[0, 3] += 0.12
    skipped = (BadFrame(known.frames[2].index, "no points"), BadFrame(99, "it is not recorded"))
    believed = Verdict(CANNOT_TELL, "too few frames", drive, skipped=skipped)
    run = replace(known, drive=drive, drive_verdict=believed)
    figures = Figures.of(run)
    assert "to 0.00° / 12 cm, 4 of 5 frames as one;" in headline(figures).replace("\u00a0", " ")
    rotation, translation, alone = (finding.sentence.replace("\u00a0", " ") for finding in findings(figures))
    assert rotation.startswith("Rotation is good") and "0.00° after; the limit is 0.3°." in rotation
    assert translation.startswith("Translation is roughly right") and "12.0 cm after; the limit is 8 cm" in translation
    assert alone.startswith("One by one, 95 % of the frames end below")
    rejected = Figures.of(replace(run, drive_verdict=replace(believed, word=REJECTED)))
    assert findings(rejected) == findings(Figures.of(known)) and headline(rejected) == headline(Figures.of(known))


def test_page_states_the_figures_of_the_run(known: RecordedRun, tmp_path: Path, fakes: ModuleType) -> None:
    page = page_of(known, tmp_path)
    figures = Figures.of(known)
    initial, corrected = figures.initial.metrics, figures.corrected.metrics
    assert corrected.rotation_deg.median == pytest.approx(fakes.LEFTOVER**3 * initial.rotation_deg.median, rel=0.05)
    assert f"Corrected 5\u00a0frames of fake/00 from {initial.rotation_deg.median:.1f}°" in page
    for state in figures.states:
        assert f"<td>{state.metrics.rotation_deg.p95:.2f}°</td>" in page
        assert f'<td class="more">{state.metrics.translation_cm.mean:.1f}\u00a0cm</td>' in page
    assert '<td class="more">100%</td><td class="more">100%</td>' in page  # 0.027 of 5° and 0.5 m is within both range_
    assert "stage 3" in page and "±5°/0.5 m" in page
    assert page.count('<div class="compare">') == 3
    assert page.count("<svg viewBox") == 4  # two curves, two histograms


def test_page_needs_nothing_but_its_pictures(known: RecordedRun, tmp_path: Path) -> None:
    page = page_of(known, tmp_path)
    assert not re.findall(r"""(?:src|href)=["']?(?:https?:)?//|@import|url\(""", page)
    assert "$" not in re.sub(r"<script>.*</script>", "", page, flags=re.DOTALL)
    for picture in re.findall(r'src="([^"]+)"', page):
        assert cv2.imread(str(tmp_path / picture)).shape[1] == PICTURE_WIDTH


def test_worst_median_and_best_are_by_what_is_left(known: RecordedRun) -> None:
    figures = Figures.of(known)
    left = [misplacement_cm(error) for error in figures.corrected.errors]
    examples = figures.examples()
    assert [left[examples[name]] for name in ("worst", "median", "best")] == [max(left), sorted(left)[2], min(left)]


def test_a_single_frame_is_shown_once_and_not_plotted(record: Callable[..., Any], tmp_path: Path) -> None:
    record(tmp_path / "one.rrd", length=1, detail="overview")
    page = page_of(read_run(tmp_path / "one.rrd"), tmp_path / "report")
    assert page.count('<div class="compare">') == 1
    assert "polyline" not in page


def test_without_reference_it_says_change_and_agreement_only(unknown: RecordedRun, tmp_path: Path) -> None:
    run = moved(unknown, [0.2, 0.21, 0.22])
    page = page_of(run, tmp_path)
    assert headline(Figures.of(run)).startswith("Changed the calibration of fake/00 by 0.00°\u00a0/\u00a021\u00a0cm")
    assert "3\u00a0frames agree within 0.00°\u00a0/\u00a01.0\u00a0cm" in page
    assert "There is no reference" in page
    assert "Frames within" not in page
    assert "corrected extrinsics takes its place, so the figures show how much the frames scatter" in page
    grades = {finding.sentence.partition(":")[0]: finding.grade for finding in findings(Figures.of(run))}
    assert grades["Translation"] == "good"


def test_frames_that_disagree_are_not_called_good(unknown: RecordedRun) -> None:
    found = findings(Figures.of(moved(unknown, [-0.4, 0.0, 0.5])))
    assert any(finding.grade == "bad" and "do not agree" in finding.sentence for finding in found)
    assert any("may have been right" in finding.sentence for finding in found)


def test_what_got_worse_is_called_so(known: RecordedRun) -> None:
    frames = tuple(
        replace(frame, initial=frame.corrected, corrected=frame.initial, stages={5: frame.initial})
        for frame in known.frames
    )
    worse = replace(known, frames=frames, stages=known.stages[-1:])
    sentences = [finding.sentence for finding in findings(Figures.of(worse)) if finding.grade == "bad"]
    assert [sentence.partition(" ")[0] for sentence in sentences] == ["Rotation", "Translation"]
    assert all("is not corrected" in s and "In 5 of 5\u00a0frames it is worse" in s for s in sentences)


def test_metrics_json_has_every_frame(known: RecordedRun, tmp_path: Path) -> None:
    write_report(known, tmp_path)
    content = json.loads((tmp_path / "metrics.json").read_text())
    assert content["measured_against"] == "reference"
    assert [stage["number"] for stage in content["stages"]] == [3, 4, 5]
    assert content["stages"][0]["range"] == "5/0.5"
    assert content["initial"].keys() == {"rotation_deg", "translation_cm", "success_2deg_5cm", "success_1deg_2.5cm"}
    assert [entry["frame"] for entry in content["per_frame"]] == [0, 1, 2, 3, 4]
    for entry, frame in zip(content["per_frame"], known.frames, strict=True):
        np.testing.assert_array_equal(entry["corrected_camera_from_lidar"], frame.corrected)
        error = frame.error(frame.stages[4])
        assert error is not None
        assert entry["errors"]["stage_4"]["translation_cm"] == pytest.approx(error.translation_cm, abs=1e-6)
    medians = [entry["errors"]["stage_5"]["rotation_deg"] for entry in content["per_frame"]]
    assert content["stages"][-1]["rotation_deg"]["median"] == pytest.approx(np.median(medians), abs=1e-6)


def test_metrics_json_without_reference_has_no_success_rates(unknown: RecordedRun, tmp_path: Path) -> None:
    write_report(unknown, tmp_path)
    content = json.loads((tmp_path / "metrics.json").read_text())
    assert content["measured_against"] == "median of the corrected extrinsics"
    assert content["stages"][-1].keys() == {"number", "range", "rotation_deg", "translation_cm"}


def test_text_of_the_recording_stays_text(known: RecordedRun, tmp_path: Path) -> None:
    evil = '<script>alert("1")</script>$title'
    frames = tuple(replace(frame, source=evil) for frame in known.frames)
    run = replace(
        known,
        frames=frames,
        title=evil,
        warning=evil,
        settings={"sequence": evil, evil: evil},
        provenance={"torch": evil},
        weights={3: {"commit": evil, "options": {"data": [evil]}}},
    )
    page = page_of(run, tmp_path)
    assert "alert" in page
    assert page.count("<script>") == 1
    assert '"1"' not in page


def test_points_are_drawn_where_they_were_recorded() -> None:
    black = cv2.imencode(".png", np.zeros((100, 400, 3), dtype=np.uint8))[1].tobytes()
    drawn = draw_overlay(black, np.array([[300.0, 20.0]]), np.array([[255, 0, 0]], dtype=np.uint8))
    picture = cv2.imdecode(np.frombuffer(drawn, dtype=np.uint8), cv2.IMREAD_COLOR)
    rows, columns = np.nonzero(picture[..., 2] > 128)
    scale = PICTURE_WIDTH / 400
    np.testing.assert_allclose([columns.mean(), rows.mean()], [300.5 * scale - 0.5, 20.5 * scale - 0.5], atol=0.6)


def call(*arguments: str | Path) -> int:
    return run(cli, [str(argument) for argument in arguments])


def test_command_keeps_other_files_and_the_recording(
    known: RecordedRun, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    (tmp_path / "index.html").write_text("my own page")
    assert call("report", known.path, "--output", tmp_path) == 3
    assert (tmp_path / "index.html").read_text() == "my own page"
    assert "not the page of a report but something else; choose another path" in capsys.readouterr().err
    assert call("report", known.path, "--output", tmp_path, "--overwrite") == 0
    capsys.readouterr()
    assert call("report", known.path, "--output", tmp_path) == 0  # an earlier report is replaced
    assert str(tmp_path / "index.html") in capsys.readouterr().out
    assert (tmp_path / "notes.txt").read_text() == "mine"
    assert (tmp_path / "recording.rrd").read_bytes() == known.path.read_bytes()
    assert not (tmp_path / "recording.rrd").samefile(known.path)
    before = (tmp_path / "index.html").read_text()
    assert call("report", tmp_path / "recording.rrd", "--output", tmp_path) == 0  # its own copy, in place
    assert (tmp_path / "index.html").read_text() == before
    assert not list(tmp_path.rglob("*.partial"))


def test_command_says_in_one_sentence_what_it_cannot_do(
    known: RecordedRun, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("")
    assert call("report", known.path, "--output", tmp_path / "file" / "below") == 3
    assert call("report", tmp_path / "missing.rrd", "--output", tmp_path / "report") == 3
    errors = capsys.readouterr().err.splitlines()
    assert len(errors) == 2
    assert "cannot be written" in errors[0] and "missing.rrd" in errors[1]


def test_a_full_disk_is_one_sentence_and_leaves_no_halves(
    known: RecordedRun, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(source: Path, target: Path) -> None:
        target.write_bytes(b"half")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("shutil.copyfile", full)
    with pytest.raises(CalibnetError, match=r"recording\.rrd cannot be written \(No space left on device\)"):
        write_report(known, tmp_path)
    assert not (tmp_path / "index.html").exists()
    assert not list(tmp_path.rglob("*.partial"))


def test_on_a_phone_no_table_is_cut(known: RecordedRun, unknown: RecordedRun, tmp_path: Path) -> None:
    wider = "table => table.getBoundingClientRect().right > innerWidth"
    with chromium() as browser:
        for name, run_ in (("known", known), ("unknown", unknown)):
            page_of(moved(run_, [3.456] * len(run_.frames)), tmp_path / name)
            page = browser.new_page(viewport={"width": 390, "height": 844})
            page.goto((tmp_path / name / "index.html").as_uri())
            assert page.locator("table.figures").count() >= 1
            assert page.evaluate(f"Array.from(document.querySelectorAll('table')).filter({wider}).length") == 0
