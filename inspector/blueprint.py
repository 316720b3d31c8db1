"""The layout of the viewer: one function a tab; only views that have data are made.

A new view is a line in its tab's function; a new stage appears by itself, since every tab walks
through `Layout.stages`.
"""

from __future__ import annotations

import math

import rerun as rr
import rerun.blueprint as rrb

from inspector import entities
from inspector.legends import LEGEND_SPACING
from inspector.observation import Detail, Grid, Layout, StageLayout, Vector

SCREEN_WIDTH, SCREEN_HEIGHT, LEGEND_HEIGHT = 1920.0, 980.0, 85.0
SCENE_BACKGROUND = (44, 47, 54)
"""Grey enough that dark points of the picture stay visible."""

View = rrb.View | rrb.Container


def make_blueprint(layout: Layout) -> rrb.Blueprint:
    """All tabs that the recording has data for."""
    tabs: list[View] = [overview_tab(layout), cascade_tab(layout)]
    inside = [stage for stage in layout.stages if stage.grids]
    if inside:
        tabs += [
            rrb.Tabs(*(cost_volume_page(stage, layout) for stage in inside), name="Cost volumes"),
            rrb.Tabs(*(hourglass_page(stage) for stage in inside), name="Hourglass"),
        ]
    tabs.append(scene_tab(layout))
    return rrb.Blueprint(
        rrb.Tabs(*tabs, active_tab=0),
        rrb.TimePanel(state="collapsed", timeline=entities.FRAME),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        auto_views=False,
        auto_layout=False,
    )


def overview_tab(layout: Layout) -> View:
    """The result at one look: three overlays, the depth colours, the error curves, the table."""
    overlays = [
        overlay_view(
            "Miscalibrated" if layout.has_reference else "Start: calibration as given", entities.OVERLAY_MISCALIBRATED
        ),
        overlay_view("Corrected", entities.OVERLAY_CORRECTED),
    ]
    if layout.has_reference:
        overlays.append(overlay_view("Reference (truth)", entities.OVERLAY_REFERENCE))
    table = rrb.TextDocumentView(origin=entities.TABLE, name="What every stage did to this frame")
    below: View = table
    if layout.has_reference:
        curves = [
            rrb.TimeSeriesView(
                origin=f"error/{kind}",
                contents=["$origin/**", f"- /{entities.error_corrected(kind)}"],
                name=f"{kind.capitalize()} error [{unit}]",
                plot_legend=rrb.PlotLegend(rrb.Corner2D.RightTop),
            )
            for kind, unit in entities.ERROR_KINDS.items()
        ]
        below = rrb.Horizontal(rrb.Vertical(*curves), table, column_shares=[1.0, 1.0])
    return rrb.Vertical(
        rrb.Horizontal(*overlays),
        legend("Depth of the points", entities.LEGEND_DEPTH),
        below,
        row_shares=_overview_rows(layout.aspect, len(overlays)),
        name="Overview",
    )


def _overview_rows(aspect: float, overlays: int) -> list[float]:
    """Heights of overlays, legend and the rest, so that the overlays fill a screen of 1920 x 1080."""
    overlay = min(SCREEN_WIDTH / overlays / aspect + 64.0, 390.0)
    return [overlay, LEGEND_HEIGHT, SCREEN_HEIGHT - LEGEND_HEIGHT - overlay]


def cascade_tab(layout: Layout) -> View:
    """The overlay after every stage, beside the displacement and confidence that led to it."""
    rows: list[View] = [
        rrb.Horizontal(
            overlay_view(
                "Before the first stage: miscalibrated" if layout.has_reference else "Start",
                entities.OVERLAY_MISCALIBRATED,
            ),
            overlay_view("Current: play the timeline “step” to see it corrected", entities.OVERLAY_CURRENT),
            legend("Colours of displacement (direction; white = none)", entities.LEGEND_DISPLACEMENT),
        )
    ]
    for stage in layout.stages:
        views: list[View] = [overlay_view(f"After {_lower(stage.title)}", entities.overlay_stage(stage.number))]
        if stage.grids:
            grid = stage.grids[0]
            views += [
                image_view(
                    f"{stage.title}: displacement found, arrows in cells of {grid.stride} px",
                    entities.displacement(stage.number),
                    grid,
                ),
                image_view(f"{stage.title}: confidence, bright = sure", entities.confidence(stage.number), grid),
            ]
        rows.append(rrb.Horizontal(*views))
    return rrb.Vertical(*rows, name="Cascade")


def cost_volume_page(stage: StageLayout, layout: Layout) -> View:
    """One row a scale: score where points are now, best match, the chosen cell's window, the tensor."""
    rows: list[View] = []
    truth = ", white true" if layout.has_reference else ""
    for grid in stage.grids:
        stride = grid.stride
        score, best = entities.score(stage.number, stride), entities.best_match(stage.number, stride)
        cell = entities.chosen_cell(stage.number, stride)
        views: list[View] = [
            image_view(f"1/{stride}: score where points are now, bright = match", score, grid, cell),
            image_view(f"1/{stride}: best match after aggregation", best, grid, cell),
            image_view(f"Red now, green found{truth}", entities.window(stage.number, stride)),
        ]
        if layout.detail is Detail.FULL:
            views.append(
                tensor_view(f"1/{stride}: whole cost volume, sliders dy dx", entities.cost_volume(stage.number, stride))
            )
        rows.append(rrb.Horizontal(*views, column_shares=[3.0, 3.0, 2.0, 3.0][: len(views)]))
    return rrb.Vertical(*rows, name=stage.title)


def hourglass_page(stage: StageLayout) -> View:
    """One row a scale: the strongest channels before and after aggregation."""
    rows = [
        rrb.Horizontal(
            image_view(
                f"1/{stride}: before the hourglass, 16 liveliest channels",
                entities.hourglass_before(stage.number, stride),
            ),
            image_view(
                f"1/{stride}: after the hourglass, 16 liveliest channels",
                entities.hourglass_after(stage.number, stride),
            ),
        )
        for stride, _, _ in stage.grids
    ]
    return rrb.Vertical(*rows, name=stage.title)


def scene_tab(layout: Layout) -> View:
    """The cloud coloured through both extrinsics, and where each stage believes the camera to be."""
    start = "miscalibrated" if layout.has_reference else "given"
    clouds = rrb.Horizontal(
        scene_view(f"Cloud coloured through the {start} extrinsic", entities.CLOUD_CORRECTED, layout),
        scene_view("Cloud coloured through the corrected extrinsic", entities.CLOUD_INITIAL, layout),
    )
    return rrb.Vertical(clouds, frustum_legend(layout), row_shares=[12.0, 1.0], name="3D")


def overlay_view(name: str, points: str) -> rrb.Spatial2DView:
    """Points over the frame's image."""
    return rrb.Spatial2DView(origin="/", contents=[f"/{entities.IMAGE}", f"/{points}/**"], name=name)


def image_view(name: str, path: str, grid: Grid | None = None, *marks: str) -> rrb.Spatial2DView:
    """A map and the marks drawn on it; with ``grid``, marks that reach beyond its cells do not widen the view."""
    if grid is None:
        return rrb.Spatial2DView(origin=f"/{path}", name=name)
    bounds = rrb.VisualBounds2D(x_range=(0.0, float(grid.width)), y_range=(0.0, float(grid.height)))
    contents = ["$origin/**", *(f"/{mark}" for mark in marks)]
    return rrb.Spatial2DView(origin=f"/{path}", contents=contents, name=name, visual_bounds=bounds)


def legend(name: str, path: str) -> rrb.Spatial2DView:
    """A static legend."""
    return rrb.Spatial2DView(origin=f"/{path}", name=name)


def frustum_legend(layout: Layout) -> rrb.Spatial2DView:
    """The names of the frustums in their colours, all in one row."""
    width = LEGEND_SPACING * (len(layout.stages) + (2 if layout.has_reference else 1))
    bounds = rrb.VisualBounds2D(x_range=(-LEGEND_SPACING / 2, width - LEGEND_SPACING / 2), y_range=(-8.0, 16.0))
    return rrb.Spatial2DView(origin=f"/{entities.LEGEND_STAGES}", name="Camera frustums", visual_bounds=bounds)


def tensor_view(name: str, path: str) -> rrb.TensorView:
    """A cost volume as an image over ``(x, y)`` with sliders for ``(dy, dx)``."""
    return rrb.TensorView(
        origin=f"/{path}",
        name=name,
        slice_selection=rrb.TensorSliceSelection(width=3, height=2, slider=[0, 1]),
        scalar_mapping=rrb.TensorScalarMapping(colormap="viridis", mag_filter="nearest"),
        view_fit="FillKeepAspectRatio",
    )


def scene_view(name: str, without: str, layout: Layout) -> rrb.Spatial3DView:
    """The scene seen over the camera's shoulder, without one of the clouds."""
    return rrb.Spatial3DView(
        origin=f"/{entities.WORLD}",
        contents=["$origin/**", f"- /{without}"],
        name=name,
        eye_controls=rrb.EyeControls3D(
            position=_seen_from(layout, ahead=-6.0, left=2.0, up=2.8),
            look_target=_seen_from(layout, ahead=12.0, left=0.0, up=-0.5),
            eye_up=(0.0, 0.0, 1.0),
        ),
        line_grid=rrb.LineGrid3D(visible=False),
        background=SCENE_BACKGROUND,
        defaults=[rr.TransformAxes3D(0.0)],
    )


def _seen_from(layout: Layout, ahead: float, left: float, up: float) -> Vector:
    """A place in the LiDAR frame, given in metres from the camera along its heading."""
    (x, y, z), (dx, dy, _) = layout.position, layout.forward
    length = math.hypot(dx, dy) or 1.0
    dx, dy = dx / length, dy / length
    return x + ahead * dx - left * dy, y + ahead * dy + left * dx, z + up


def _lower(title: str) -> str:
    return title[0].lower() + title[1:]
