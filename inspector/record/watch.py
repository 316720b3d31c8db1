"""The recording of a drive that was watched: what its frames say over time, in a band, and where that changes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import rerun as rr
import rerun.blueprint as rrb

from calibnet.watch import WINDOW, Watch
from inspector import colors, entities
from inspector.record.stream import Stream
from inspector.run.watching import AXES, in_units

BAND = 2.0
"""Standard deviations on either side: 95 % of the errors of a window, if noise is as it is measured."""
TEXT = "watch/result"
CURVES = {
    "frames": ("single frames", colors.REST, 1.0),
    "estimate": (f"mean of {WINDOW} frames", colors.FOUND, 2.5),
    "upper": (f"+{BAND:g} σ", colors.LIMIT, 1.0),
    "lower": (f"-{BAND:g} σ", colors.LIMIT, 1.0),
}
"""Of every axis: its name, colour and width."""
CHANGE = "change"
"""Mark of an axis at frames where the mount has moved."""


def curve(axis: str, kind: str) -> str:
    """Path of a curve of an axis."""
    return f"watch/{axis}/{kind}"


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
        text = "\n\n".join([f"# {lines[-1]}", *lines[:-1]])
        stream.rec.log(TEXT, rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN), static=True)
        if found is not None:
            _log(stream.rec, found)
    finally:
        stream.close()
    return stream.remark


def _log(rec: rr.RecordingStream, found: Watch) -> None:
    for axis in AXES:
        for kind, (name, color, width) in CURVES.items():
            rec.log(curve(axis, kind), rr.SeriesLines(names=name, colors=color, widths=width), static=True)
        rec.log(curve(axis, CHANGE), rr.SeriesPoints(names="the mount has moved", colors=colors.INITIAL), static=True)
    moved = {change.frame for change in found.changes if change.until is None}
    said, means, sigma = in_units(found.offsets), in_units(found.windowed), BAND * in_units(found.sigma)
    for row, frame in enumerate(found.frames):
        rec.set_time(entities.FRAME, sequence=int(frame))
        levels = {"frames": said, "estimate": means, "upper": means + sigma, "lower": means - sigma}
        for column, axis in enumerate(AXES):
            for kind, values in levels.items():
                rec.log(curve(axis, kind), rr.Scalars(float(values[row, column])))
            if int(frame) in moved:
                rec.log(curve(axis, CHANGE), rr.Scalars(float(means[row, column])))


def watch_blueprint() -> rrb.Blueprint:
    """What came of it beside six plots."""
    units = {axis: "cm" if axis in ("x", "y", "z") else "deg" for axis in AXES}
    views = [
        rrb.TimeSeriesView(
            name=f"{axis.capitalize()} off the whole drive's [{unit}]",
            origin=f"/watch/{axis}",
            plot_legend=rrb.PlotLegend(visible=axis == AXES[0]),
        )
        for axis, unit in units.items()
    ]
    text = rrb.TextDocumentView(origin=TEXT, name="Did the mount move?")
    return rrb.Blueprint(
        rrb.Horizontal(text, rrb.Grid(*views, grid_columns=3), column_shares=[0.24, 0.76]),
        rrb.TimePanel(timeline=entities.FRAME, state="collapsed"),
        collapse_panels=True,
    )
