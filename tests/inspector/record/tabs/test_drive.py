"""The estimate from a whole drive, in words and in the recording."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rerun as rr
from rerun.chunk import RrdReader

from calibnet.geometry import miscalibration, transform
from calibnet.geometry.types import Transform
from calibnet.trace import DriveEstimate, Estimate
from calibnet.verdict import BadFrame, Cause, Verdict
from inspector import entities
from inspector.read.run import read_run
from inspector.record.subtree import Subtree
from inspector.record.tabs.drive import curve, deviation, drive_sentence, log_drive
from inspector.verdicts import certainty
from tests.support.fakes import FakeCascade

REFERENCE = transform([[0, -1, 0], [0, 0, -1], [1, 0, 0]], [0.0, -0.1, -0.2])
SIGMA = np.array([0.02, 0.03, 0.06, *np.radians([0.1, 0.2, 0.2])])


def found(degrees: float, metres: float) -> Transform:
    """Off the reference by so much yaw, and to the right."""
    return miscalibration([0, 0, degrees], [metres, 0, 0]) @ REFERENCE


def offset_cm(pose: Transform) -> float:
    return float(100 * np.linalg.norm(pose[:3, 3] - REFERENCE[:3, 3]))


def estimate(aligned: bool) -> DriveEstimate:
    early, late = (Estimate(found(angle, 0.0), 4 * np.diag(SIGMA**2), count) for angle, count in ((2.0, 1), (0.5, 3)))
    networks = Estimate(found(1.5, 0.12), np.diag(SIGMA**2) / 100, 3)
    last = DriveEstimate(late.camera_from_lidar, np.diag(SIGMA**2), 3)
    history = ((0, early), (2, Estimate(last.camera_from_lidar, last.covariance, 3)))
    return DriveEstimate(
        last.camera_from_lidar,
        last.covariance,
        3,
        history,
        skipped=(BadFrame(1, "It is cut short."),),
        networks=networks if aligned else None,
    )


def test_the_sentence_says_what_alignment_changed() -> None:
    sentence = drive_sentence(estimate(aligned=True), REFERENCE, found(5, 0.3))
    assert sentence.startswith("Whole drive as one (3 frames, 1 more could not be used): off by 0.50° / ")
    assert "±0.30° / 7.0 cm (1σ). Before" in sentence
    before = offset_cm(found(1.5, 0.12))
    assert sentence.endswith(f"Before its edges were aligned: 1.50° / {before:.1f} cm.")


def test_networks_alone_are_said_not_to_know_what_they_share() -> None:
    sentence = drive_sentence(estimate(aligned=False), None, found(5, 0.3))
    assert "changed the calibration by 4.50° / " in sentence and "aligned" not in sentence
    assert sentence.endswith("±0.30° / 7.0 cm (1σ) by the frames' scatter, not counting what all of them get wrong.")


def test_a_reason_that_says_how_certain_it_is_is_not_followed_by_another_figure() -> None:
    plain = Verdict("accepted", "3 frames agree.", REFERENCE, (0.1, 2.0), covariance=np.diag(SIGMA**2))
    assert certainty(plain) == "±0.30° / 7.0 cm (1σ)."
    for reason in ("It is off by 0.10° ± 0.2° and 2 ± 4 cm.", "The frames determine it only to 0.3° and 7 cm (1σ)."):
        assert certainty(replace(plain, reason=reason)) == ""


def test_deviations_have_the_units_of_their_curves() -> None:
    one = estimate(aligned=True)
    found_units = [deviation(one, name) for name in ("x", "y", "z", "pitch", "yaw", "roll")]
    assert found_units == pytest.approx([2, 3, 6, 0.1, 0.2, 0.2])


def shown(file: Path) -> str:
    """The text beside the curves."""
    chunks = RrdReader(file).store().stream().filter(content=f"/{entities.DRIVE_TEXT}")
    texts = [text for chunk in chunks for (text,) in chunk.to_record_batch()["TextDocument:text"].to_pylist()]
    (text,) = texts  # "Not solved yet", which stood there during the run, is gone with the index
    return str(text)


def test_the_verdict_is_recorded_and_shown_with_what_was_skipped(
    tmp_path: Path, record: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    one = estimate(aligned=True)
    cause = Cause("time-offset", "Scans seem 0.1 s later than their images.", "best at 0.09 s")
    verdict = Verdict(
        "cannot tell", "Edges disagree.", one.camera_from_lidar, (1.0, 9.0), (cause,), one.covariance, 3, one.skipped
    )
    monkeypatch.setattr(FakeCascade, "calibrate_drive", lambda *_: replace(one, verdict=verdict), raising=False)
    summary = record(tmp_path / "drive.rrd", detail="overview", strides=(32,), drive=True)
    assert summary.verdict == "Verdict: cannot tell. Edges disagree. Scans seem 0.1 s later than their images."
    recorded = read_run(tmp_path / "drive.rrd")
    assert recorded.drive_verdict is not None and recorded.verdict is recorded.drive_verdict
    assert recorded.drive_verdict.as_dict() == verdict.as_dict()
    assert recorded.drive_verdict.skipped == (BadFrame(1, "It is cut short."),)
    text = shown(tmp_path / "drive.rrd")
    assert text.startswith("# Cannot tell\n\nEdges disagree.\n\n- **time-offset**: Scans seem 0.1 s later")
    assert "±0.30° / 7.0 cm (1σ)." in text
    assert "- frame 1: It is cut short." in text


def test_curves_and_the_result_are_recorded(tmp_path: Path, full_recording: Path) -> None:
    rec = rr.RecordingStream("calib-inspect")
    rec.save(tmp_path / "drive.rrd")
    rr.send_chunks(RrdReader(full_recording).store().stream(), recording=rec)
    log_drive(Subtree(rec), estimate(aligned=True), REFERENCE, {0: 0.0, 2: 0.2})
    rec.disconnect()
    np.testing.assert_array_equal(read_run(tmp_path / "drive.rrd").drive, found(0.5, 0.0))
    curves: dict[str, list[float]] = {}
    for chunk in RrdReader(tmp_path / "drive.rrd").store().stream():
        batch = chunk.to_record_batch()
        for name in ("estimate", "upper", "lower"):
            if chunk.entity_path == f"/{curve('yaw', name)}" and "Scalars:scalars" in batch.schema.names:
                curves.setdefault(name, []).extend(v[0] for v in batch.column("Scalars:scalars").to_pylist() if v)
    assert sorted(curves["estimate"]) == pytest.approx([0.5, 2.0])
    assert sorted(curves["upper"]) == pytest.approx([0.5 + 0.2, 2.0 + 0.4])
    assert sorted(curves["lower"]) == pytest.approx([0.5 - 0.2, 2.0 - 0.4])
