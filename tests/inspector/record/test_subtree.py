"""Logging below a prefix: paths, timelines, and what is said once."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import rerun as rr
from rerun.chunk import RrdReader

from inspector.record.subtree import Subtree, below

Read = Callable[..., list[tuple[Any, Any]]]


@pytest.mark.parametrize(
    ("prefix", "entity", "path"),
    [
        ("", "overlay/corrected", "overlay/corrected"),
        ("", "/", "/"),
        ("left", "overlay/corrected", "left/overlay/corrected"),
        ("/car/left/", "/overlay/corrected", "car/left/overlay/corrected"),
    ],
)
def test_paths(prefix: str, entity: str, path: str) -> None:
    assert below(prefix, entity) == path


def test_what_holds_at_all_times_is_written_once_below_each_prefix(tmp_path: Path) -> None:
    stream = rr.RecordingStream("mine")
    stream.save(tmp_path / "once.rrd")
    for prefix in ("left", "left", "right"):
        for text in ("first", "second"):
            Subtree(stream, prefix).log_once("note", rr.TextDocument(text))
    stream.disconnect()
    chunks = list(RrdReader(tmp_path / "once.rrd").store().stream().filter(content=["/left/**", "/right/**"]))
    assert all(chunk.is_static for chunk in chunks)
    written = [(chunk.entity_path, chunk.to_record_batch()["TextDocument:text"].to_pylist()) for chunk in chunks]
    assert sorted(written) == [("/left/note", [["first"]]), ("/right/note", [["first"]])]


def test_timelines(tmp_path: Path, read: Read) -> None:
    stream = rr.RecordingStream("mine")
    stream.save(tmp_path / "times.rrd")
    rec = Subtree(stream, "left")
    rec.set_frame(7, 0.7)
    rec.log("value", rr.Scalars(1.0))
    rec.set_step(7, 5)
    rec.log("value", rr.Scalars(2.0))
    stream.disconnect()
    steps, frames, times = (
        [
            (time, value.as_py())
            for time, value in read(tmp_path / "times.rrd", "left/value", "Scalars:scalars", timeline)
        ]
        for timeline in ("step", "frame", "time")
    )
    assert steps == [(56, [1.0]), (61, [2.0])]
    assert [frame for frame, _ in frames] == [7, 7]
    assert [time.total_seconds() for time, _ in times] == [0.7, 0.7]
