"""The views that tabs are made of: one function a kind."""

from __future__ import annotations

import math

import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint.encodings import ComponentSourceKind, VisualizerComponentMapping

from inspector import entities
from inspector.record.contents import Coloring
from inspector.record.observation import Grid, Layout, Place
from inspector.record.pictures.legends import LEGEND_SPACING

SCREEN_WIDTH, SCREEN_HEIGHT, LEGEND_HEIGHT = 1920.0, 980.0, 64.0
TITLE_HEIGHT = 36.0
DIMMED = 0.65
"""Opacity of the image under points, so that these stand out."""
SCENE_BACKGROUND = (44, 47, 54)
"""Grey enough that dark points of the picture stay visible."""
COLORED_BY = {
    Coloring.DEPTH: "Depth of the points",
    Coloring.INTENSITY: "Intensity of the points",
    Coloring.EDGE: "Points at depth edges",
    Coloring.ERROR: "Points: pixels off against the reference",
}

View = rrb.View | rrb.Container


def overlay_view(name: str, points: str, image: tuple[int, int] | None = None) -> rrb.Spatial2DView:
    """Points over the frame's image; with its size, points and captions beyond it do not widen the view."""
    bounds = None if image is None else rrb.VisualBounds2D(x_range=(0.0, image[0]), y_range=(0.0, image[1]))
    return rrb.Spatial2DView(
        origin="/",
        contents=[f"/{entities.IMAGE}", f"/{points}/**"],
        name=name,
        visual_bounds=bounds,
        overrides={f"/{entities.IMAGE}": rr.EncodedImage.from_fields(opacity=DIMMED)},
    )


def image_view(name: str, path: str, grid: Grid | None = None, *marks: str) -> rrb.Spatial2DView:
    """A map and the marks drawn on it; with ``grid``, marks that reach beyond its cells do not widen the view."""
    if grid is None:
        return rrb.Spatial2DView(origin=f"/{path}", name=name)
    bounds = rrb.VisualBounds2D(x_range=(0.0, float(grid.width)), y_range=(0.0, float(grid.height)))
    contents = ["$origin/**", *(f"/{mark}" for mark in marks)]
    return rrb.Spatial2DView(origin=f"/{path}", contents=contents, name=name, visual_bounds=bounds)


def legend(name: str, path: str) -> rrb.Spatial2DView:
    """A static legend, without a title bar: its labels say it."""
    return rrb.Spatial2DView(origin=f"/{path}", name=name, titlebar=False)


def point_legend(layout: Layout) -> rrb.Spatial2DView:
    """What the colours of the overlays' points stand for."""
    return legend(COLORED_BY[layout.contents.color], entities.LEGEND_POINTS)


def names_legend(name: str, path: str, count: int) -> rrb.Spatial2DView:
    """So many names in their colours, in one row."""
    bounds = rrb.VisualBounds2D(x_range=(-LEGEND_SPACING / 2, LEGEND_SPACING * (count - 0.5)), y_range=(-8.0, 16.0))
    return rrb.Spatial2DView(origin=f"/{path}", name=name, visual_bounds=bounds, titlebar=False)


def frustum_legend(layout: Layout) -> rrb.Spatial2DView:
    """The names of the frustums in their colours."""
    return names_legend("Cameras", entities.LEGEND_STAGES, len(layout.stages) + (2 if layout.has_reference else 1))


def curve_view(kind: str, unit: str) -> rrb.TimeSeriesView:
    """The error of every stage over the frames."""
    return rrb.TimeSeriesView(
        origin=f"error/{kind}",
        contents=["$origin/**", f"- /{entities.error_corrected(kind)}"],
        name=f"{kind.capitalize()} error [{unit}]",
        plot_legend=rrb.PlotLegend(rrb.Corner2D.RightTop),
    )


def fit_view() -> rrb.TimeSeriesView:
    """How far off every stage expects its matches to be, over the frames."""
    return rrb.TimeSeriesView(
        origin=entities.FIT,
        name="Fit of picture and scan: matches expected to be off by [px]",
        plot_legend=rrb.PlotLegend(rrb.Corner2D.RightTop),
    )


def tensor_view(name: str, path: str) -> rrb.TensorView:
    """A cost volume as an image over ``(x, y)`` with sliders for ``(dy, dx)``."""
    return rrb.TensorView(
        origin=f"/{path}",
        name=name,
        slice_selection=rrb.TensorSliceSelection(width=3, height=2, slider=[0, 1]),
        scalar_mapping=rrb.TensorScalarMapping(colormap="viridis", mag_filter="nearest"),
        view_fit="FillKeepAspectRatio",
    )


def scene_view(name: str, through: str, cameras: list[str], layout: Layout) -> rrb.Spatial3DView:
    """The cloud seen over the camera's shoulder.

    Args:
        name: of the view.
        through: whose colours the cloud has: a component of `entities.COLORS_THROUGH`.
        cameras: entities of the frustums to draw.
        layout: says where the camera is.
    """
    colors = VisualizerComponentMapping(
        target="Points3D:colors",
        source_kind=ComponentSourceKind.SourceComponent,
        source_component=f"{entities.COLORS_THROUGH}:{through}",
    )
    return rrb.Spatial3DView(
        origin=f"/{entities.WORLD}",
        contents=[f"/{path}/**" for path in (entities.CLOUD, entities.LIDAR, *cameras)],
        name=name,
        overrides={f"/{entities.CLOUD}": [rr.Points3D.from_fields().visualizer(mappings=[colors])]},
        eye_controls=rrb.EyeControls3D(
            position=_seen_from(layout, ahead=-5.0, left=1.5, up=2.8),
            look_target=_seen_from(layout, ahead=12.0, left=0.0, up=-1.8),
            eye_up=(0.0, 0.0, 1.0),
        ),
        line_grid=rrb.LineGrid3D(visible=False),
        background=SCENE_BACKGROUND,
        defaults=[rr.TransformAxes3D(0.0)],
    )


def _seen_from(layout: Layout, ahead: float, left: float, up: float) -> Place:
    """A place in the LiDAR frame, given in metres from the camera along its heading."""
    (x, y, z), (dx, dy, _) = layout.position, layout.forward
    length = math.hypot(dx, dy) or 1.0
    dx, dy = dx / length, dy / length
    return x + ahead * dx - left * dy, y + ahead * dy + left * dx, z + up
