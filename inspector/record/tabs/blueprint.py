"""The layout of the viewer: one function a tab; only views that have data are made.

A new view is a line in its tab's function; a new stage appears by itself, since every tab walks
through `Layout.stages`. Tabs with something for every stage have a page for each.
"""

from __future__ import annotations

import rerun.blueprint as rrb

from inspector import entities
from inspector.record.contents import Part
from inspector.record.observation import Grid, Layout, StageLayout
from inspector.record.tabs.drive import drive_tab
from inspector.record.tabs.views import (
    LEGEND_HEIGHT,
    SCREEN_HEIGHT,
    SCREEN_WIDTH,
    TITLE_HEIGHT,
    View,
    curve_view,
    fit_view,
    frustum_legend,
    image_view,
    names_legend,
    overlay_view,
    point_legend,
    scene_view,
    tensor_view,
)

LARGEST_OVERLAY = 390.0
"""Height in pixels beyond which curves and table of the overview would have too little room."""
LEGEND_SHARE = 0.06
"""Of a tab's height that its legend takes."""
FRAMES_PER_SECOND = 10.0
"""Speed at which frames play: that of KITTI's scanner."""


def make_blueprint(layout: Layout) -> rrb.Blueprint:
    """All tabs that the recording has data for."""
    parts = layout.contents.parts
    inside = [stage for stage in layout.stages if stage.grids]
    tabs: list[View] = [overview_tab(layout)]
    if layout.stages and parts & {Part.OVERLAYS, Part.VOLUMES}:
        tabs.append(cascade_tab(layout))
    if inside and parts & {Part.VOLUMES, Part.TENSORS}:
        tabs.append(rrb.Tabs(*(cost_volume_page(stage, layout) for stage in inside), name="Cost volumes"))
    if inside and Part.HOURGLASS in parts:
        tabs.append(rrb.Tabs(*(hourglass_page(stage) for stage in inside), name="Hourglass"))
    if Part.SCENE in parts:
        tabs.append(scene_tab(layout))
    if layout.as_one:
        tabs.append(drive_tab(layout.has_reference))
    return rrb.Blueprint(
        rrb.Tabs(*tabs, active_tab=0),
        rrb.TimePanel(state="collapsed", timeline=entities.FRAME, fps=FRAMES_PER_SECOND),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        auto_views=False,
        auto_layout=False,
    )


def overview_tab(layout: Layout) -> View:
    """The result at one look: three overlays, their legend, the error curves, the table."""
    overlays = [
        overlay_view(layout.start, entities.OVERLAY_MISCALIBRATED, layout.image),
        overlay_view("Corrected", entities.OVERLAY_CORRECTED, layout.image),
    ]
    if layout.has_reference:
        overlays.append(overlay_view("Reference (truth)", entities.OVERLAY_REFERENCE, layout.image))
    below: View = rrb.TextDocumentView(origin=entities.TABLE, name="What every stage did to this frame")
    if layout.stages and Part.CURVES in layout.contents.parts:
        kinds = entities.ERROR_KINDS.items() if layout.has_reference else ()
        curves = [*(curve_view(kind, unit) for kind, unit in kinds), fit_view()]
        below = rrb.Horizontal(rrb.Vertical(*curves), below, column_shares=[1.0, 1.0])
    width, height = layout.image
    overlay = min(SCREEN_WIDTH / len(overlays) * height / width + TITLE_HEIGHT, LARGEST_OVERLAY)
    return rrb.Vertical(
        rrb.Horizontal(*overlays),
        point_legend(layout),
        below,
        row_shares=[overlay, LEGEND_HEIGHT, SCREEN_HEIGHT - LEGEND_HEIGHT - overlay],
        name="Overview",
    )


def cascade_tab(layout: Layout) -> View:
    """The overlay after every stage side by side, one after the other on ``step``, and what each stage saw."""
    pages: list[View] = []
    if Part.OVERLAYS in layout.contents.parts:
        overlays = [overlay_view(f"Start: {layout.start.lower()}", entities.OVERLAY_MISCALIBRATED, layout.image)]
        overlays += [
            overlay_view(f"After {_lower(stage.title)}", entities.overlay_stage(stage.number), layout.image)
            for stage in layout.stages
        ]
        columns = 2 if len(overlays) > 1 else 1
        current = overlay_view(
            "Choose the timeline “step” below and play: start, then every stage", entities.OVERLAY_CURRENT, layout.image
        )
        pages = [
            _with_legend(rrb.Grid(*overlays, grid_columns=columns), point_legend(layout), "All stages"),
            _with_legend(current, point_legend(layout), "Step by step"),
        ]
    if Part.VOLUMES in layout.contents.parts:
        pages += [_stage_page(stage, layout) for stage in layout.stages if stage.grids]
    return rrb.Tabs(*pages, name="Cascade")


def _stage_page(stage: StageLayout, layout: Layout) -> View:
    """What one stage saw: where it moves the points, and how sure it is."""
    grid = stage.grids[0]
    maps = [
        image_view(
            f"Displacement found: colour and arrow point to where the image fits (cells of {grid.stride} px)",
            entities.displacement(stage.number),
            grid,
        ),
        image_view("Confidence, 0 unsure to 1 a pixel or better", entities.confidence(stage.number), grid),
    ]
    rows: list[View] = [rrb.Horizontal(*maps)]
    if Part.OVERLAYS in layout.contents.parts:
        earlier = layout.stages[: layout.stages.index(stage)]
        name = f"Before: after stage {earlier[-1].number}" if earlier else f"Before: {layout.start.lower()}"
        path = entities.overlay_stage(earlier[-1].number) if earlier else entities.OVERLAY_MISCALIBRATED
        after = overlay_view("After: " + _lower(stage.title), entities.overlay_stage(stage.number), layout.image)
        rows.insert(0, rrb.Horizontal(overlay_view(name, path, layout.image), after))
    return rrb.Vertical(*rows, _map_legends(), row_shares=[1.0] * len(rows) + [0.25], name=stage.title)


def cost_volume_page(stage: StageLayout, layout: Layout) -> View:
    """One row a scale: which displacement won, which is true, how surely, and the window of one cell."""
    parts = layout.contents.parts
    maps: View = rrb.Vertical(
        *(_volume_row(stage.number, grid, layout) for grid in stage.grids),
        _map_legends(names_legend("Marks in the window", entities.LEGEND_WINDOW, 3 if layout.has_reference else 2)),
        row_shares=[1.0] * len(stage.grids) + [0.35],
        name="Which displacement won" if Part.TENSORS in parts else stage.title,
    )
    if Part.TENSORS not in parts:
        return maps
    slices = rrb.Vertical(*(_slice_row(stage.number, grid) for grid in stage.grids), name="All displacements")
    return rrb.Tabs(*([maps] if Part.VOLUMES in parts else []), slices, name=stage.title)


def _volume_row(number: int, grid: Grid, layout: Layout) -> View:
    stride, cell = grid.stride, entities.chosen_cell(number, grid.stride)
    views: list[View] = [
        image_view(f"1/{stride}: displacement that won", entities.best_match(number, stride), grid, cell)
    ]
    if layout.has_reference:
        views.append(image_view(f"1/{stride}: true displacement", entities.true_match(number, stride), grid, cell))
    views += [
        image_view(f"1/{stride}: how surely (peak probability)", entities.peak_probability(number, stride), grid, cell),
        image_view(f"1/{stride}: window of the pink cell", entities.window(number, stride)),
    ]
    return rrb.Horizontal(*views, column_shares=[3.0] * (len(views) - 1) + [2.6])


def _slice_row(number: int, grid: Grid) -> View:
    stride = grid.stride
    every = f"1/{stride}: a tile for every displacement, dx → dy ↓, steps of {stride} px; bright = probable"
    return rrb.Horizontal(
        image_view(every, entities.slices(number, stride)),
        tensor_view(f"1/{stride}: raw scores, sliders dy dx", entities.cost_volume(number, stride)),
        tensor_view(f"1/{stride}: probability, sliders dy dx", entities.probability(number, stride)),
        column_shares=[2.0, 1.0, 1.0],
    )


def hourglass_page(stage: StageLayout) -> View:
    """One row a scale: the liveliest channels before and after aggregation."""
    rows = [
        rrb.Horizontal(
            image_view(
                f"1/{stride}: channels that vary most (number above), before the hourglass",
                entities.hourglass_before(stage.number, stride),
            ),
            image_view(
                f"1/{stride}: after the hourglass, same colour scale as before",
                entities.hourglass_after(stage.number, stride),
            ),
        )
        for stride, _, _ in stage.grids
    ]
    return rrb.Vertical(*rows, name=stage.title)


def scene_tab(layout: Layout) -> View:
    """The cloud coloured through one extrinsic after the other, and where each believes the camera to be."""
    seen = {layout.start: ("initial", entities.CAMERA_INITIAL)}
    seen |= {stage.title: (f"stage_{stage.number}", entities.camera_stage(stage.number)) for stage in layout.stages}
    last, (through, _) = list(seen.items())[-1]
    if layout.has_reference:
        seen["Reference (truth)"] = ("reference", entities.CAMERA_REFERENCE)
    truth = [entities.CAMERA_REFERENCE] if layout.has_reference else []
    cameras = [camera for _, camera in seen.values()]
    compared = {_lower(layout.start): "initial"}
    if layout.stages:
        compared[f"after {_lower(last)}"] = through
    if layout.has_reference:
        compared["reference"] = "reference"
    views = [scene_view(f"Coloured through: {name}", part, cameras, layout) for name, part in compared.items()]
    pages = [
        scene_view(name, through, list(dict.fromkeys([camera, *truth])), layout)
        for name, (through, camera) in seen.items()
    ]
    return rrb.Tabs(_with_legend(rrb.Horizontal(*views), frustum_legend(layout), "Side by side"), *pages, name="3D")


def _with_legend(view: View, below: View, name: str) -> View:
    return rrb.Vertical(view, below, row_shares=[1.0 - LEGEND_SHARE, LEGEND_SHARE], name=name)


def _map_legends(*more: View) -> View:
    """Colours of displacements and of certainty, and what else a page needs."""
    return rrb.Horizontal(
        rrb.Spatial2DView(
            origin=f"/{entities.LEGEND_DISPLACEMENT}", name="Displacement: hue = direction, white = none"
        ),
        rrb.Spatial2DView(origin=f"/{entities.LEGEND_CERTAINTY}", name="Probability, confidence"),
        *more,
    )


def _lower(title: str) -> str:
    return title[0].lower() + title[1:]
