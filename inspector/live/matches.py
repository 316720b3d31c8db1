"""The first tab beside the page: where every stage searched for one point of the scan, and where it found it.

A click on a point moves all of these windows, so they are shown side by side. They are few, since a viewer without a
graphics card takes long for each.
"""

from __future__ import annotations

import rerun as rr
import rerun.blueprint as rrb

from inspector import colors, entities
from inspector.record.contents import Contents
from inspector.record.observation import Grid, Layout, Observation, StageLayout
from inspector.record.pictures.legends import log_names
from inspector.record.subtree import Subtree
from inspector.record.tabs import cost_volumes
from inspector.record.tabs.cost_volumes import WINDOW
from inspector.record.tabs.views import View, legend, scale_name

NAME = "Why there?"
LEGEND = "legend/matches"
LEGEND_SHARE = 0.12
TITLE = "title"
"""Entity with the name of a stage's window above it; Rerun's title bar has no room for it beside its buttons."""
TITLE_CELLS = 0.8
"""Distance from a window to its title, in cells."""


def wanted(layout: Layout) -> bool:
    """Whether there are cost volumes."""
    return cost_volumes.wanted(layout)


def log_once(rec: Subtree, layout: Layout) -> None:
    """Log the titles of the windows, which *Cost volumes* logs, and the legend of their marks."""
    names = {"where the point was": colors.INITIAL, "where it was found": colors.FOUND}
    log_names(rec, LEGEND, names | ({"where it belongs": colors.REFERENCE} if layout.has_reference else {}))
    for stage in layout.stages_with_volumes:
        grid = _finest(stage)
        title = rr.Points2D(
            [(grid.window / 2, -TITLE_CELLS)],
            labels=[f"stage {stage.number}, {scale_name(grid)}"],
            colors=colors.LETTERS,
            radii=0.0,
            show_labels=True,
        )
        rec.log_once(entities.of_scale(stage.number, grid.stride, TITLE), title)


def log(rec: Subtree, observation: Observation, contents: Contents) -> None:
    """Log nothing, since *Cost volumes* logs it."""


def view(layout: Layout) -> View:
    """The windows at the finest scale of all stages, in a row."""
    windows = [_window(stage.number, _finest(stage)) for stage in layout.stages_with_volumes]
    marks = legend("Marks in the windows", LEGEND)
    return rrb.Vertical(rrb.Horizontal(*windows), marks, row_shares=[1.0 - LEGEND_SHARE, LEGEND_SHARE], name=NAME)


def _finest(stage: StageLayout) -> Grid:
    return min(stage.grids, key=lambda grid: grid.stride)


def _window(number: int, grid: Grid) -> View:
    return rrb.Spatial2DView(
        origin=f"/{entities.of_scale(number, grid.stride, WINDOW)}",
        contents=["$origin/**", f"/{entities.of_scale(number, grid.stride, TITLE)}"],
        name=f"Stage {number}, {scale_name(grid)}",
        titlebar=False,
        background=colors.GROUND,
    )
