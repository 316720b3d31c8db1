"""Tab *Hourglass*: the probability within each cell's window before and after aggregation, and the activations.

A cell is decided when one displacement has all probability of its search window; with a reference, a map shows the
share on the true displacement. Before aggregation, it is the probability by the matching scores alone. The same
channels are shown before and after. Activations that leave the hourglass are about ten times as large as those that
enter, so each side has a scale of its own above it.
"""

from __future__ import annotations

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from calibnet.trace import ScaleTrace, StageTrace
from inspector import colors, entities
from inspector.record.contents import Contents, Part
from inspector.record.observation import Grid, Layout, Observation, StageLayout
from inspector.record.pictures.channel_grid import channel_grid, liveliest_channels, palette_png
from inspector.record.pictures.legends import log_decided_legend
from inspector.record.pictures.maps import (
    decidedness,
    mass_on_truth,
    matching_probability,
    share_image,
    within_window,
)
from inspector.record.pictures.matches import StartingPoints
from inspector.record.subtree import Subtree
from inspector.record.tabs.views import View, image_view, legend, map_view, scale_name, with_legend

NAME = "Hourglass"

# entities of every scale of every stage, see `entities.of_scale`
DECIDED_BEFORE = "decided_before"
"""How decided each cell is by the matching scores alone."""
DECIDED_AFTER = "decided_after"
"""How decided each cell is by the aggregated volume."""
TRUTH_BEFORE = "on_truth_before"
"""Share of a window's probability within a cell of the true displacement, by the matching scores alone."""
TRUTH_AFTER = "on_truth_after"
"""The same share by the aggregated volume."""
BEFORE = "hourglass_before"
"""Activations that enter the hourglass, channels side by side."""
AFTER = "hourglass_after"
"""Activations that leave the hourglass, channels side by side."""


def wanted(layout: Layout) -> bool:
    """Whether the run kept activations, and they are recorded."""
    return bool(layout.stages_with_volumes) and Part.HOURGLASS in layout.contents.parts


def log_once(rec: Subtree, layout: Layout) -> None:
    """Log the legend of brightness."""
    log_decided_legend(rec, layout.has_reference)


def log(rec: Subtree, observation: Observation, contents: Contents) -> None:
    """Log the maps and channels of every stage that kept them."""
    if Part.HOURGLASS not in contents.parts:
        return
    for stage in observation.trace.stages:
        if stage.detail is not None:
            points = StartingPoints.of(observation, stage)
            for scale in contents.scales(stage.detail):
                _log_probability(rec, stage, scale, points)
                _log_activations(rec, stage.number, scale)


def view(layout: Layout) -> View:
    """For every stage, a page with its probabilities and one with its channels, with a row for every scale."""
    return rrb.Tabs(*(_stage_pages(stage, layout) for stage in layout.stages_with_volumes), name=NAME)


def _stage_pages(stage: StageLayout, layout: Layout) -> View:
    alone = len(stage.grids) == 1
    probability = rrb.Vertical(*(_probability_row(stage.number, grid, layout, alone) for grid in stage.grids))
    channels = rrb.Vertical(*(_channels_row(stage.number, grid) for grid in stage.grids), name="Channels")
    words = legend("Decided", entities.LEGEND_DECIDED)
    return rrb.Tabs(with_legend(probability, words, "Where the probability went"), channels, name=stage.title)


def _probability_row(number: int, grid: Grid, layout: Layout, alone: bool) -> View:
    scale = scale_name(grid)
    names = {DECIDED_BEFORE: "decided, before", DECIDED_AFTER: "decided, after"}
    if layout.has_reference:
        names |= {TRUTH_BEFORE: "share on the truth, before", TRUTH_AFTER: "share on the truth, after"}
    views = [
        map_view(f"{scale}: {name}", entities.of_scale(number, grid.stride, path), number, grid)
        for path, name in names.items()
    ]
    return rrb.Grid(*views, grid_columns=2) if alone else rrb.Horizontal(*views)


def _channels_row(number: int, grid: Grid) -> View:
    scale = scale_name(grid)
    return rrb.Horizontal(
        image_view(f"{scale}: channels before the hourglass", entities.of_scale(number, grid.stride, BEFORE)),
        image_view(f"{scale}: the same channels after it", entities.of_scale(number, grid.stride, AFTER)),
    )


def _log_probability(rec: Subtree, stage: StageTrace, scale: ScaleTrace, points: StartingPoints) -> None:
    """Log how decided the windows are and their share on the truth, before and after aggregation."""
    before = matching_probability(scale)
    maps = {DECIDED_BEFORE: decidedness(before), DECIDED_AFTER: decidedness(scale.probability)}
    seen = dict.fromkeys(maps, scale.occupied)
    true = points.true_field(scale.stride)
    if true is not None:
        cells = true / scale.stride
        maps |= {TRUTH_BEFORE: mass_on_truth(before, cells), TRUTH_AFTER: mass_on_truth(scale.probability, cells)}
        seen |= dict.fromkeys((TRUTH_BEFORE, TRUTH_AFTER), scale.occupied & within_window(scale, cells))
    for name, values in maps.items():
        rec.log(entities.of_scale(stage.number, scale.stride, name), share_image(values, seen[name]))


def _log_activations(rec: Subtree, number: int, scale: ScaleTrace) -> None:
    """Log the channels that vary most after aggregation, of those that both sides have."""
    both = min(len(scale.before), len(scale.after))
    channels = liveliest_channels(scale.after[:both])
    for name, activations in ((BEFORE, scale.before), (AFTER, scale.after)):
        shown = activations[channels]
        low, high = colors.robust_limits(np.asarray(shown).ravel())
        picture = palette_png(channel_grid(shown, low, high, channels))
        path = entities.of_scale(number, scale.stride, name)
        rec.log(path, rr.EncodedImage(contents=picture, media_type="image/png"))
