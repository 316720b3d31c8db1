"""The recording of a drive that was watched: what its frames say over time, in a band, and where that changes."""

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
        title: of the recording.
        recording_id: the same for the same data.
        found: what was found; None where there is only something to say.
        lines: what is said, the result last.

    Returns:
        What a user has to know about how it was closed; empty for nothing.
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
    """What came of it beside six plots."""
    panel = rrb.TimePanel(timeline=entities.FRAME, state="collapsed")
    return rrb.Blueprint(watch_view(), panel, collapse_panels=True)
