"""Tab *Cascade*: the overlay after every stage, and the displacements and confidences of each stage.

Overlays belong to `Part.OVERLAYS`; on the timeline `entities.STEP` one of them steps through the stages of a frame. A
stage's displacements and confidences belong to `Part.VOLUMES`.
"""

from __future__ import annotations

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from calibnet.trace import StageDetail
from inspector import entities
from inspector.record.contents import Contents, Part
from inspector.record.observation import Layout, Observation, StageLayout
from inspector.record.pictures.frame_overlays import frame_overlays
from inspector.record.pictures.legends import log_map_legends, log_point_legend
from inspector.record.pictures.maps import certainty_image, flow_image, reach_px
from inspector.record.subtree import Subtree
from inspector.record.tabs.views import (
    View,
    frame_view,
    in_rows,
    map_legends,
    map_view,
    point_legend,
    uncapitalized,
    with_legend,
)

NAME = "Cascade"

ARROW_SPACING = (2, 3)
"""Smallest and largest distance between arrows of the displacement field, in cells; long arrows are farther apart."""
ARROW_COLOR = (20, 20, 20)


def displacement(stage: int) -> str:
    """Entity of the displacements of the LiDAR cells, as a map in flow colours."""
    return f"stage_{stage}/displacement"


def displacement_arrows(stage: int) -> str:
    """Entity of the displacements as arrows, in cells."""
    return f"{displacement(stage)}/arrows"


def confidence(stage: int) -> str:
    """Entity of the confidence of each displacement."""
    return f"stage_{stage}/confidence"


def wanted(layout: Layout) -> bool:
    """Whether stages ran, and their overlays or maps are recorded."""
    return bool(layout.stages and layout.contents.parts & {Part.OVERLAYS, Part.VOLUMES})


def log_once(rec: Subtree, layout: Layout) -> None:
    """Log the legends of points and maps."""
    log_point_legend(rec, layout.contents.color)
    if Part.VOLUMES in layout.contents.parts:
        log_map_legends(rec)


def log(rec: Subtree, observation: Observation, contents: Contents) -> None:
    """Log the overlay after every stage, and every stage's displacements."""
    if Part.OVERLAYS in contents.parts:
        _log_overlays(rec, observation, contents)
    if Part.VOLUMES in contents.parts:
        for stage in observation.trace.stages:
            if stage.detail is not None:
                _log_displacement(rec, stage.number, stage.detail)


def view(layout: Layout) -> View:
    """A page with all overlays, one with the overlay that steps through the stages, and one for every stage."""
    pages: list[View] = []
    if Part.OVERLAYS in layout.contents.parts:
        shown = {f"Start: {layout.start.lower()}": entities.OVERLAY_MISCALIBRATED}
        shown |= {
            f"After {uncapitalized(stage.title)}": entities.overlay_stage(stage.number) for stage in layout.stages
        }
        overlays = [frame_view(layout, name, path, small=True) for name, path in shown.items()]
        columns = 2 if len(overlays) > 1 else 1
        current = frame_view(
            layout,
            "Choose the timeline “step” below and play: start, every stage, truth, result",
            entities.OVERLAY_CURRENT,
        )
        pages = [
            with_legend(in_rows(overlays, columns), point_legend(layout), "All stages"),
            with_legend(current, point_legend(layout), "Step by step"),
        ]
    if Part.VOLUMES in layout.contents.parts:
        pages += [_stage_page(stage, layout) for stage in layout.stages if stage.grids]
    return rrb.Tabs(*pages, name="Steps" if layout.method else NAME)


def _stage_page(stage: StageLayout, layout: Layout) -> View:
    """Overlays before and after one stage, its displacements and its confidences."""
    grid = stage.grids[0]
    maps = [
        map_view(
            f"Displacement found: colour and arrow point to where the image fits (cells of {grid.stride} px)",
            displacement(stage.number),
            stage.number,
            grid,
        ),
        map_view("Confidence, 0 unsure to 1 a pixel or better", confidence(stage.number), stage.number, grid),
    ]
    rows: list[View] = [rrb.Horizontal(*maps)]
    if Part.OVERLAYS in layout.contents.parts:
        earlier = layout.stages[: layout.stages.index(stage)]
        name = f"Before: after stage {earlier[-1].number}" if earlier else f"Before: {layout.start.lower()}"
        path = entities.overlay_stage(earlier[-1].number) if earlier else entities.OVERLAY_MISCALIBRATED
        after = frame_view(
            layout, "After: " + uncapitalized(stage.title), entities.overlay_stage(stage.number), small=True
        )
        rows.insert(0, rrb.Horizontal(frame_view(layout, name, path, small=True), after))
    return rrb.Vertical(*rows, map_legends(), row_shares=[1.0] * len(rows) + [0.25], name=stage.title)


def _log_overlays(rec: Subtree, observation: Observation, contents: Contents) -> None:
    frame, trace = observation.frame, observation.trace
    overlays = frame_overlays(observation, contents)
    overlays.log(rec, entities.OVERLAY_CURRENT, observation.start, trace.initial)
    for stage in trace.stages:
        name = f"after stage {stage.number}"
        overlays.log(rec, entities.overlay_stage(stage.number), name, stage.after)
        rec.set_step(frame.index, stage.number)
        overlays.log(rec, entities.OVERLAY_CURRENT, name, stage.after)
        rec.set_step(frame.index, 0)
    if observation.reference is not None:
        rec.set_step(frame.index, entities.STEP_REFERENCE)
        overlays.log_reference(rec, entities.OVERLAY_CURRENT, observation.reference)
    rec.set_step(frame.index, entities.STEP_RESULT)  # last, since the other timelines show what is logged last
    overlays.log_result(rec, entities.OVERLAY_CURRENT)
    rec.set_step(frame.index, 0)


def _log_displacement(rec: Subtree, number: int, results: StageDetail) -> None:
    """The displacement field as flow colours with arrows, and its confidence."""
    finest = results.scales[0]
    seen = results.confidence > 0
    rec.log(displacement(number), flow_image(results.displacement, reach_px(finest), seen))
    rows, columns = np.nonzero(seen)
    lengths = np.linalg.norm(results.displacement[seen], axis=1) / finest.stride
    every = int(np.clip(np.median(lengths), *ARROW_SPACING)) if len(lengths) else 1
    drawn = (rows % every == 0) & (columns % every == 0)
    rows, columns = rows[drawn], columns[drawn]
    rec.log(
        displacement_arrows(number),
        rr.Arrows2D(
            origins=np.stack([columns + 0.5, rows + 0.5], axis=1),
            vectors=results.displacement[rows, columns] / finest.stride,
            colors=ARROW_COLOR,
            radii=rr.Radius.ui_points(1.2),
        ),
    )
    rec.log(confidence(number), certainty_image(results.confidence, seen))
