"""Tab *Did it move?*: the estimate over a drive, each axis with its band, and the changes.

It exists if `Layout.with_watch` is set; a recording of ``calib-inspect watch`` shows nothing else.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType

import rerun as rr
import rerun.blueprint as rrb

from calibnet.watch import WINDOW, Watch
from inspector import colors, entities
from inspector.mount_changes import AXES, in_units
from inspector.record.contents import Contents
from inspector.record.observation import Layout, Observation
from inspector.record.pictures.legends import log_names
from inspector.record.subtree import Subtree
from inspector.record.tabs.drive import PARAMETERS
from inspector.record.tabs.views import View, curve_view, frames_named, legend, with_legend

NAME = "Did it move?"

LEGEND = "legend/watch"
CURVES = {
    "frames": ("single frames", colors.REST, 1.0),
    "estimate": (f"mean of {WINDOW} frames", colors.FOUND, 2.5),
    "upper": ("+1σ", colors.LIMIT, 1.0),
    "lower": ("-1σ", colors.LIMIT, 1.0),
}
"""Curves of every axis: name, colour and width."""
CHANGE = "change"
"""Mark of an axis at frames where the mount moved."""
MARK_SIZE = 6.0
NOT_YET = "# Not checked yet\n\nWhether the mount moved is checked once the whole drive is solved."
TEXT_SHARE = 0.24
"""Share of the tab's width that the text takes."""


def curve(axis: str, kind: str) -> str:
    """Entity of a curve of an axis."""
    return f"watch/{axis}/{kind}"


def wanted(layout: Layout) -> bool:
    """Whether a drive with enough frames is solved."""
    return layout.with_watch


def log_once(rec: Subtree, layout: Layout) -> None:
    """Log names and colours of the curves."""
    log_curve_styles(rec, frames_named(layout))
    rec.log_once(entities.WATCH_TEXT, rr.TextDocument(NOT_YET, media_type=rr.MediaType.MARKDOWN))


def log(rec: Subtree, observation: Observation, contents: Contents) -> None:
    """Log nothing for a single frame, since a change needs those around it; see `log_watch`."""


def log_curve_styles(rec: Subtree, more: Mapping[str, colors.Rgb] = MappingProxyType({})) -> None:
    """Log names and colours of the curves, and their legend with further entries."""
    names = {CURVES["frames"][0]: colors.REST, CURVES["estimate"][0]: colors.FOUND}
    names |= {"± one standard deviation": colors.LIMIT, "the mount moved": colors.INITIAL}
    log_names(rec, LEGEND, {**names, **more})
    mark = rr.SeriesPoints(names="the mount moved", colors=colors.INITIAL, marker_sizes=MARK_SIZE)
    for axis in AXES:
        for kind, (name, color, width) in CURVES.items():
            rec.log_once(curve(axis, kind), rr.SeriesLines(names=name, colors=color, widths=width))
        rec.log_once(curve(axis, CHANGE), mark)


def log_watch(rec: Subtree, found: Watch | None, lines: Sequence[str], to_frame: Callable[[int], None]) -> None:
    """Log the result of watching a drive.

    Args:
        rec: recording to log to.
        found: the estimate over the drive; None if there is only text.
        lines: lines of text, the result last.
        to_frame: sets the timelines to a frame by its number.
    """
    text = "\n\n".join([f"# {lines[-1]}", *lines[:-1]])
    rec.log_for_all(entities.WATCH_TEXT, rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN))
    if found is None:
        return
    moved = {change.frame for change in found.changes if change.until is None}
    said, means, sigma = in_units(found.offsets), in_units(found.windowed), in_units(found.sigma)
    levels = {"frames": said, "estimate": means, "upper": means + sigma, "lower": means - sigma}
    for row, frame in enumerate(found.frames):
        to_frame(int(frame))
        for column, axis in enumerate(AXES):
            for kind, values in levels.items():
                rec.log(curve(axis, kind), rr.Scalars(float(values[row, column])))
            if int(frame) in moved:
                rec.log(curve(axis, CHANGE), rr.Scalars(float(means[row, column])))


def view(layout: Layout) -> View:
    """The result as text beside six plots."""
    return watch_view()


def watch_view() -> View:
    """The same view without a layout."""
    views = [
        curve_view(f"{axis.capitalize()} against the whole drive [{unit}]", f"/watch/{axis}")
        for axis, unit in PARAMETERS.items()
    ]
    text = rrb.TextDocumentView(origin=entities.WATCH_TEXT, name="Did the mount move?")
    curves = with_legend(rrb.Grid(*views, grid_columns=3), legend("Curves", LEGEND), "Curves")
    return rrb.Horizontal(text, curves, column_shares=[TEXT_SHARE, 1 - TEXT_SHARE], name=NAME)
