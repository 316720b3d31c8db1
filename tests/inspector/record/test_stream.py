"""A process that records again and again keeps nothing of the recordings that it closed."""

from __future__ import annotations

from pathlib import Path

import psutil
import pytest
import rerun.blueprint as rrb
from rerun.blueprint.components import PlayState
from rerun.chunk import RrdReader

from inspector.record.stream import Stream, release_closed
from tests.hostile.test_kills import files_of_at_most


def record(file: Path) -> None:
    views = [rrb.TextDocumentView(origin=f"/{number}", name=str(number)) for number in range(5)]
    Stream("calib-inspect", file.stem, "title", [file], rrb.Blueprint(rrb.Tabs(*views), rrb.TimePanel())).close()
    release_closed()


def test_closed_recordings_leave_no_threads_and_have_their_layout(tmp_path: Path) -> None:
    record(tmp_path / "first.rrd")
    threads = psutil.Process().num_threads()
    for number in range(5):
        record(tmp_path / f"{number}.rrd")
    assert psutil.Process().num_threads() <= threads  # it was four more a recording
    assert len(RrdReader(tmp_path / "4.rrd").blueprints()) == 1


def test_a_whole_recording_stands_still_when_it_is_opened(tmp_path: Path) -> None:
    record(tmp_path / "whole.rrd")
    (layout,) = RrdReader(tmp_path / "whole.rrd").blueprints()
    panel = RrdReader(tmp_path / "whole.rrd").stream(store=layout).filter(content="/time_panel")
    states = [chunk.to_record_batch().to_pydict().get("TimePanelBlueprint:play_state") for chunk in panel]
    assert [[PlayState.Paused.value]] in states


def test_a_quota_that_is_full_is_told_before_rerun_waits_for_it_for_ever(tmp_path: Path) -> None:
    with files_of_at_most(4096), pytest.raises(OSError, match="File too large") as caught:
        record(tmp_path / "run.rrd")
    assert caught.value.filename == str(tmp_path / "run.rrd")
