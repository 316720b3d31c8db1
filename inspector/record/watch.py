"""Records a watched drive: the estimate over time with its band, and the changes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import rerun.blueprint as rrb

from calibnet.watch import Watch
from inspector import entities
from inspector.record.stream import Stream
from inspector.record.subtree import Subtree
from inspector.record.tabs.views import span_named
from inspector.record.tabs.watch import log_curve_styles, log_watch, watch_view


def record_watch(sinks: Sequence[Any], title: str, recording_id: str, found: Watch | None, lines: Sequence[str]) -> str:
    """Write the recording.

    Args:
        sinks: files and Rerun sinks, see `inspector.record.outputs`.
        title: title of the recording.
        recording_id: recording id, which is the same for the same data.
        found: the estimate over the drive; None if there is only text.
        lines: lines of text, the result last.

    Returns:
        A note for the user on how the recording was closed; empty for none.
    """
    stream = Stream(entities.APPLICATION_ID, recording_id, title, sinks, watch_blueprint())
    try:
        rec = Subtree(stream.rec)
        log_curve_styles(rec, {} if found is None else span_named(int(found.frames[0]), int(found.frames[-1])))
        log_watch(rec, found, lines, lambda frame: stream.rec.set_time(entities.FRAME, sequence=frame))
    finally:
        stream.close()
    return stream.remark


def watch_blueprint() -> rrb.Blueprint:
    """The layout: the result as text beside six plots."""
    panel = rrb.TimePanel(timeline=entities.FRAME, state="collapsed")
    return rrb.Blueprint(watch_view(), panel, collapse_panels=True)
