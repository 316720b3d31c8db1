"""Tab *Cost volumes*: the best and the true displacement of every cell, and the volumes themselves.

The maps and the search window of one cell belong to `Part.VOLUMES`, the raw volumes and all their slices to
`Part.TENSORS`.
"""

from __future__ import annotations

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from calibnet.trace import ScaleTrace, StageDetail, StageTrace
from inspector import colors, entities
from inspector.record.contents import Contents, Part
from inspector.record.observation import Grid, Layout, Observation, StageLayout
from inspector.record.pictures.legends import log_map_legends, log_names
from inspector.record.pictures.maps import certainty_image, flow_image, reach_px, subcell_match
from inspector.record.pictures.matches import StartingPoints, chosen_match, match_of
from inspector.record.pictures.search_window import CELL_FRAME, SearchWindow
from inspector.record.pictures.slices import slice_marks, slices_picture
from inspector.record.subtree import Subtree
from inspector.record.tabs.views import (
    View,
    image_view,
    legend,
    map_legends,
    map_view,
    scale_name,
    tensor_view,
    with_legend,
)

NAME = "Cost volumes"

# entities of every scale of every stage, see `entities.of_scale`
COST_VOLUME = "cost_volume"
"""The matching scores as a tensor ``dy, dx, y, x``."""
PROBABILITY = "probability"
"""The aggregated volume, a softmax over the window, as a tensor ``dy, dx, y, x``."""
BEST_MATCH = "best_match"
"""Displacement that is the most probable, in fractions of a cell, as flow colours."""
TRUE_MATCH = "true_match"
"""Displacement to where the reference puts each cell's point, as flow colours."""
PEAK_PROBABILITY = "peak_probability"
"""Probability of the best match of each cell."""
LOW_PROBABILITIES = 0.3
"""Exponent by which small probabilities are seen too: those of most displacements are below a hundredth."""
SLICES = "slices"
"""All slices of the aggregated volume side by side, one for every displacement."""
SLICE_MARKS = f"{SLICES}/marks"
"""Frames around the slice that won most cells and the one that holds the true displacement."""
WINDOW = "window"
"""The search window of the chosen cell."""
WINDOW_CELLS = f"{WINDOW}/cells"
"""Frames in the window around the cell where the point is now and the one where it was found."""
WINDOW_TRUTH = f"{WINDOW}/truth"
"""True position of the point in the window, or on its border if outside."""
CHOSEN_CELL = "chosen_cell"
"""A frame around the chosen cell, drawn over the maps."""

LEGEND_SLICES = "legend/slices"
"""Legend of the frames among the slices."""
SLICES_SHOW = "one tile per displacement; bright = probable"
"""What stands beside the legend, since titles of small views have no room for it."""
LEGEND_WINDOW = "legend/window"
"""Legend of the marks in the search window."""
TENSOR_DIMENSIONS = ("dy", "dx", "y", "x")


def wanted(layout: Layout) -> bool:
    """Whether the run kept cost volumes, and their maps or the volumes are recorded."""
    return bool(layout.stages_with_volumes and layout.contents.parts & {Part.VOLUMES, Part.TENSORS})


def log_once(rec: Subtree, layout: Layout) -> None:
    """Log the legends of the maps and of the marks in the window."""
    true = {"true": colors.REFERENCE} if layout.has_reference else {}
    if Part.TENSORS in layout.contents.parts:
        marks = {"tile of no displacement": colors.INITIAL, "won most cells": colors.FOUND}
        log_names(rec, LEGEND_SLICES, marks | true | {SLICES_SHOW: colors.GROUND})
    if Part.VOLUMES in layout.contents.parts:
        log_map_legends(rec)
        log_names(
            rec, LEGEND_WINDOW, {"cell shown": CELL_FRAME, "point now": colors.INITIAL, "found": colors.FOUND} | true
        )


def log(rec: Subtree, observation: Observation, contents: Contents) -> None:
    """Log the cost volumes of every stage that kept them."""
    if not contents.parts & {Part.VOLUMES, Part.TENSORS}:
        return
    for stage in observation.trace.stages:
        if stage.detail is not None:
            _log_stage(rec, observation, stage, stage.detail, contents)


def view(layout: Layout) -> View:
    """A page for every stage."""
    return rrb.Tabs(*(_stage_page(stage, layout) for stage in layout.stages_with_volumes), name=NAME)


def _stage_page(stage: StageLayout, layout: Layout) -> View:
    """A row for every scale: maps and the window of one cell on one page, slices and raw volumes on another."""
    parts = layout.contents.parts
    pages: list[View] = []
    if Part.VOLUMES in parts:
        name = "Which displacement won" if Part.TENSORS in parts else stage.title
        pages.append(_maps_page(stage, layout, name))
    if Part.TENSORS in parts:
        pages.append(with_legend(_slices(stage), legend("Framed tiles", LEGEND_SLICES), "All displacements"))
        rows = (_tensor_row(stage.number, grid) for grid in stage.grids)
        pages.append(rrb.Vertical(*rows, name="One displacement, by sliders"))
        return rrb.Tabs(*pages, name=stage.title)
    return pages[0]


def _maps_page(stage: StageLayout, layout: Layout, name: str) -> View:
    legends = map_legends(legend("Marks in the window", LEGEND_WINDOW))
    rows = [_map_row(stage.number, grid, layout, len(stage.grids) == 1) for grid in stage.grids]
    return rrb.Vertical(*rows, legends, row_shares=[1.0] * len(rows) + [0.35], name=name)


def _map_row(number: int, grid: Grid, layout: Layout, alone: bool) -> View:
    def path(name: str) -> str:
        return entities.of_scale(number, grid.stride, name)

    scale, cell = scale_name(grid), path(CHOSEN_CELL)
    views: list[View] = [map_view(f"{scale}: displacement that won", path(BEST_MATCH), number, grid, cell)]
    if layout.has_reference:
        views.append(map_view(f"{scale}: true displacement", path(TRUE_MATCH), number, grid, cell))
    views += [
        map_view(f"{scale}: peak probability", path(PEAK_PROBABILITY), number, grid, cell),
        image_view(f"{scale}: search window", path(WINDOW)),
    ]
    if alone:
        return rrb.Grid(*views, grid_columns=2)
    return rrb.Horizontal(*views, column_shares=[3.0] * (len(views) - 1) + [2.6])


def _slices(stage: StageLayout) -> View:
    """The slices, the finest scale large and the others beside it."""
    finest, *others = (_slices_view(stage.number, grid) for grid in stage.grids)
    return rrb.Horizontal(finest, rrb.Vertical(*others), column_shares=[2.0, 1.0]) if others else finest


def _slices_view(number: int, grid: Grid) -> View:
    return image_view(scale_name(grid), entities.of_scale(number, grid.stride, SLICES))


def _tensor_row(number: int, grid: Grid) -> View:
    kinds = {COST_VOLUME: "matching scores", PROBABILITY: "probability after the hourglass"}
    return rrb.Horizontal(
        *(
            tensor_view(
                f"{scale_name(grid)}: {kind}, displaced by dy, dx (middle: not at all)",
                entities.of_scale(number, grid.stride, name),
                gamma=LOW_PROBABILITIES if name == PROBABILITY else 1.0,
            )
            for name, kind in kinds.items()
        )
    )


def _log_stage(
    rec: Subtree, observation: Observation, stage: StageTrace, results: StageDetail, contents: Contents
) -> None:
    points = StartingPoints.of(observation, stage)
    match = chosen_match(points, results)
    for scale in contents.scales(results):
        true = points.true_field(scale.stride)
        if Part.VOLUMES in contents.parts:
            _log_maps(rec, stage.number, scale, true)
            if match is not None:
                _log_window(rec, stage.number, scale, SearchWindow(scale, match))
        if Part.TENSORS in contents.parts:
            _log_tensors(rec, stage.number, scale)
            rec.log(entities.of_scale(stage.number, scale.stride, SLICES), slices_picture(scale))
            rec.log(entities.of_scale(stage.number, scale.stride, SLICE_MARKS), slice_marks(scale, true))


def log_windows(rec: Subtree, observation: Observation, contents: Contents, point: int) -> None:
    """Move the windows of every stage to the cell of a point, by its row in the scan, where the stage has it."""
    for stage in observation.trace.stages:
        if stage.detail is None:
            continue
        match = match_of(StartingPoints.of(observation, stage), point)
        if match is not None:
            for scale in contents.scales(stage.detail):
                _log_window(rec, stage.number, scale, SearchWindow(scale, match))


def _log_maps(rec: Subtree, number: int, scale: ScaleTrace, true: NDArray[np.float32] | None) -> None:
    """Log the best displacement of every cell, its probability, and the true displacement."""
    stride, reach = scale.stride, reach_px(scale)
    best = flow_image(subcell_match(scale) * stride, reach, scale.occupied)
    rec.log(entities.of_scale(number, stride, BEST_MATCH), best)
    peak = certainty_image(scale.probability.max(axis=(0, 1)), scale.occupied)
    rec.log(entities.of_scale(number, stride, PEAK_PROBABILITY), peak)
    if true is not None:
        rec.log(entities.of_scale(number, stride, TRUE_MATCH), flow_image(true, reach, scale.occupied))


def _log_window(rec: Subtree, number: int, scale: ScaleTrace, window: SearchWindow) -> None:
    """Log the search window of the chosen cell, and that cell on the maps."""
    rec.log(entities.of_scale(number, scale.stride, CHOSEN_CELL), window.frame())
    rec.log(entities.of_scale(number, scale.stride, WINDOW), window.scores())
    rec.log(entities.of_scale(number, scale.stride, WINDOW_CELLS), window.cells())
    truth = window.truth()
    if truth is not None:
        rec.log(entities.of_scale(number, scale.stride, WINDOW_TRUTH), truth)


def _log_tensors(rec: Subtree, number: int, scale: ScaleTrace) -> None:
    """Log the raw volume before and after aggregation."""
    low, high = (
        colors.robust_limits(scale.volume)[0],
        float(scale.volume.max()),
    )  # most of the highest values are in one slice
    raw = rr.Tensor(scale.volume, dim_names=TENSOR_DIMENSIONS, value_range=(low, max(high, low + 1e-3)))
    rec.log(entities.of_scale(number, scale.stride, COST_VOLUME), raw)
    aggregated = rr.Tensor(scale.probability, dim_names=TENSOR_DIMENSIONS)
    rec.log(entities.of_scale(number, scale.stride, PROBABILITY), aggregated)
