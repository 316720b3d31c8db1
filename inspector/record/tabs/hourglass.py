"""Tab *Hourglass*: how far each cell has decided before and after aggregation, and the activations behind that.

Decided means that the probability of the search window lies on one displacement. Before aggregation it is that of the
matching scores alone; the channels below are the same ones on both sides, each side on a colour scale of its own.
"""

from __future__ import annotations

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from calibnet.trace import ScaleTrace
from inspector import colors, entities
from inspector.record.contents import Contents, Part
from inspector.record.observation import Grid, Layout, Observation, StageLayout
from inspector.record.pictures.channel_grid import channel_grid, liveliest_channels, palette_png
from inspector.record.pictures.legends import log_decided_legend
from inspector.record.pictures.maps import decidedness, matching_probability
from inspector.record.subtree import Subtree
from inspector.record.tabs.views import View, image_view, legend, with_legend

NAME = "Hourglass"

# entities of every scale of every stage, see `entities.of_scale`
DECIDED_BEFORE = "decided_before"
"""How far the matching scores alone decide each cell."""
DECIDED_AFTER = "decided_after"
"""How far the aggregated volume does."""
BEFORE = "hourglass_before"
"""Activations entering the hourglass, channels side by side."""
AFTER = "hourglass_after"
"""Activations leaving it, channels side by side."""


def wanted(layout: Layout) -> bool:
    """Where the run kept activations, and they are recorded."""
    return bool(layout.stages_with_volumes) and Part.HOURGLASS in layout.contents.parts


def log_once(rec: Subtree, layout: Layout) -> None:
    """Log what is bright."""
    log_decided_legend(rec)


def log(rec: Subtree, observation: Observation, contents: Contents) -> None:
    """Log what aggregation did in every stage that kept it."""
    if Part.HOURGLASS not in contents.parts:
        return
    for stage in observation.trace.stages:
        for scale in contents.scales(stage.detail):
            _log_decided(rec, stage.number, scale)
            _log_activations(rec, stage.number, scale)


def view(layout: Layout) -> View:
    """A page for every stage, on it a row for every scale."""
    return rrb.Tabs(*map(_stage_page, layout.stages_with_volumes), name=NAME)


def _stage_page(stage: StageLayout) -> View:
    rows = rrb.Vertical(*(_row(stage.number, grid) for grid in stage.grids))
    return with_legend(rows, legend("Decided", entities.LEGEND_DECIDED), stage.title)


def _row(number: int, grid: Grid) -> View:
    scale = f"1/{grid.stride}"

    def path(name: str) -> str:
        return entities.of_scale(number, grid.stride, name)

    return rrb.Horizontal(
        image_view(f"{scale}: decided, before the hourglass", path(DECIDED_BEFORE), grid),
        image_view(f"{scale}: decided, after it", path(DECIDED_AFTER), grid),
        image_view(f"{scale}: channels before", path(BEFORE)),
        image_view(f"{scale}: the same channels after", path(AFTER)),
    )


def _log_decided(rec: Subtree, number: int, scale: ScaleTrace) -> None:
    before, after = decidedness(matching_probability(scale)), decidedness(scale.probability)
    for name, decided in ((DECIDED_BEFORE, before), (DECIDED_AFTER, after)):
        picture = colors.map_colors(decided, 0.0, 1.0)
        picture[~scale.occupied] = colors.EMPTY
        rec.log(entities.of_scale(number, scale.stride, name), rr.Image(picture))


def _log_activations(rec: Subtree, number: int, scale: ScaleTrace) -> None:
    """The channels that vary most after aggregation, of those that both sides have."""
    both = min(len(scale.before), len(scale.after))
    channels = liveliest_channels(scale.after[:both])
    for name, activations in ((BEFORE, scale.before), (AFTER, scale.after)):
        shown = activations[channels]
        low, high = colors.robust_limits(np.asarray(shown).ravel())
        picture = palette_png(channel_grid(shown, low, high, channels))
        path = entities.of_scale(number, scale.stride, name)
        rec.log(path, rr.EncodedImage(contents=picture, media_type="image/png"))
