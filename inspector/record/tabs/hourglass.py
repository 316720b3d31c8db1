"""Tab *Hourglass*: the activations of the channels that vary most, before and after aggregation."""

from __future__ import annotations

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from calibnet.trace import ScaleTrace
from inspector import colors, entities
from inspector.record.contents import Contents, Part
from inspector.record.observation import Grid, Layout, Observation
from inspector.record.pictures.channel_grid import channel_grid, palette_png
from inspector.record.subtree import Subtree
from inspector.record.tabs.views import View, image_view

NAME = "Hourglass"

# entities of every scale of every stage, see `entities.of_scale`
BEFORE = "hourglass_before"
"""Activations entering the hourglass, channels side by side."""
AFTER = "hourglass_after"
"""Activations leaving it, channels side by side."""


def wanted(layout: Layout) -> bool:
    """Where the run kept activations, and they are recorded."""
    return bool(layout.stages_with_volumes) and Part.HOURGLASS in layout.contents.parts


def log_once(rec: Subtree, layout: Layout) -> None:
    """Log nothing: the views' names say what is bright."""


def log(rec: Subtree, observation: Observation, contents: Contents) -> None:
    """Log the activations of every stage that kept them."""
    if Part.HOURGLASS not in contents.parts:
        return
    for stage in observation.trace.stages:
        for scale in contents.scales(stage.detail):
            _log_activations(rec, stage.number, scale)


def view(layout: Layout) -> View:
    """A page for every stage, on it a row for every scale."""
    pages = (
        rrb.Vertical(*(_row(stage.number, grid) for grid in stage.grids), name=stage.title)
        for stage in layout.stages_with_volumes
    )
    return rrb.Tabs(*pages, name=NAME)


def _row(number: int, grid: Grid) -> View:
    stride = grid.stride
    return rrb.Horizontal(
        image_view(
            f"1/{stride}: channels that vary most (number above), before the hourglass",
            entities.of_scale(number, stride, BEFORE),
        ),
        image_view(
            f"1/{stride}: after the hourglass, same colour scale as before",
            entities.of_scale(number, stride, AFTER),
        ),
    )


def _log_activations(rec: Subtree, number: int, scale: ScaleTrace) -> None:
    """Both sides on one colour scale."""
    low, high = colors.robust_limits(np.concatenate([scale.before.ravel(), scale.after.ravel()]))
    for name, activations in ((BEFORE, scale.before), (AFTER, scale.after)):
        picture = palette_png(channel_grid(activations, low, high))
        path = entities.of_scale(number, scale.stride, name)
        rec.log(path, rr.EncodedImage(contents=picture, media_type="image/png"))
