"""The tab in front beside the page: where every stage searched for one point of the scan, and where it found it.

A click on a point moves all of these windows, so they stand side by side. They are few, since a viewer without a
graphics card takes long for every view.
"""

from __future__ import annotations

import rerun.blueprint as rrb

from inspector import entities
from inspector.record.contents import Contents
from inspector.record.observation import Layout, Observation
from inspector.record.subtree import Subtree
from inspector.record.tabs import cost_volumes
from inspector.record.tabs.cost_volumes import LEGEND_WINDOW, WINDOW
from inspector.record.tabs.views import View, image_view, legend, scale_name

NAME = "Why there?"
LEGEND_SHARE = 0.12


def wanted(layout: Layout) -> bool:
    """Where there are cost volumes."""
    return cost_volumes.wanted(layout)


def log_once(rec: Subtree, layout: Layout) -> None:
    """Log nothing: *Cost volumes* logs the windows and their legend."""


def log(rec: Subtree, observation: Observation, contents: Contents) -> None:
    """Log nothing, as above."""


def view(layout: Layout) -> View:
    """The window of the finest cells of every stage, in a row."""
    windows = list[View]()
    for stage in layout.stages_with_volumes:
        finest = min(stage.grids, key=lambda grid: grid.stride)
        windows.append(
            image_view(
                f"Stage {stage.number}, {scale_name(finest)}", entities.of_scale(stage.number, finest.stride, WINDOW)
            )
        )
    marks = legend("Marks in the windows", LEGEND_WINDOW)
    return rrb.Vertical(rrb.Horizontal(*windows), marks, row_shares=[1.0 - LEGEND_SHARE, LEGEND_SHARE], name=NAME)
