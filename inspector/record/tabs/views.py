"""Views that several tabs use: one function for each kind of view and of legend."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import rerun as rr
import rerun.blueprint as rrb

from inspector import colors, entities
from inspector.record.contents import Coloring
from inspector.record.observation import Grid, Layout
from inspector.record.pictures.captions import caption_strip

SCREEN_WIDTH, SCREEN_HEIGHT = 1920.0, 980.0
"""Screen size in pixels for which tabs are laid out."""
LEGEND_HEIGHT, TITLE_HEIGHT = 64.0, 36.0
LEGEND_SHARE = 0.06
"""Share of a page's height for its legend."""
SMALL_POINT = 1 / 600
"""Radius of points over a small picture, relative to the image's width: they cover the same share of it at any size."""
DIMMED = 0.65
"""Opacity of the image under points, so that points stand out."""
COLORED_BY = {
    Coloring.DEPTH: "Depth of the points",
    Coloring.INTENSITY: "Intensity of the points",
    Coloring.EDGE: "Points at depth edges",
    Coloring.ERROR: "Points: pixels off against the reference",
}

TO_THE_END = rr.TimeRangeBoundary.infinite()

View = rrb.View | rrb.Container


def overlay_view(
    name: str,
    points: str,
    image: tuple[int, int],
    figures: bool = True,
    image_of: str = entities.IMAGE,
    small: bool = False,
) -> rrb.Spatial2DView:
    """A view of points over the frame's image, with a caption above.

    Args:
        name: name of the view.
        points: entity of the overlay.
        image: size of the image, so that points outside do not widen the view.
        figures: whether captions have errors, which a recording without a reference has not.
        image_of: entity of the image.
        small: whether the size of points follows that of the picture, and is the same for all. It is fixed on the
            screen where the picture is large on any, so that zooming separates points.
    """
    bounds = rrb.VisualBounds2D(x_range=(0.0, image[0]), y_range=(-caption_strip(image, figures).height, image[1]))
    overrides: dict[Any, Any] = {f"/{image_of}": rr.EncodedImage.from_fields(opacity=DIMMED)}
    if small:
        overrides[f"/{points}"] = rr.Points2D.from_fields(radii=SMALL_POINT * image[0])
    return rrb.Spatial2DView(
        origin="/",
        contents=[f"/{image_of}", f"/{points}/**"],
        name=name,
        visual_bounds=bounds,
        background=colors.GROUND,
        overrides=overrides,
    )


def frame_view(
    layout: Layout, name: str, points: str, image_of: str = entities.IMAGE, small: bool = False
) -> rrb.Spatial2DView:
    """The `overlay_view` of a recording's frames."""
    return overlay_view(name, points, layout.image, layout.has_reference, image_of, small)


def map_view(name: str, path: str, stage: int, grid: Grid, *marks: str) -> rrb.Spatial2DView:
    """A view of a map of one scale of a stage, over the image that the stage saw, with marks."""
    return image_view(name, path, grid, entities.of_scale(stage, grid.stride, entities.PICTURE), *marks)


def image_view(name: str, path: str, grid: Grid | None = None, *marks: str) -> rrb.Spatial2DView:
    """A view of an image with marks; with ``grid``, marks outside its cells do not widen the view."""
    if grid is None:
        return rrb.Spatial2DView(origin=f"/{path}", name=name, background=colors.GROUND)
    bounds = rrb.VisualBounds2D(x_range=(0.0, float(grid.width)), y_range=(0.0, float(grid.height)))
    contents = ["$origin/**", *(f"/{mark}" for mark in marks)]
    return rrb.Spatial2DView(
        origin=f"/{path}", contents=contents, name=name, visual_bounds=bounds, background=colors.GROUND
    )


def in_rows(views: Sequence[View], columns: int) -> View:
    """Views in rows of at most ``columns``, of which a shorter last one fills the width: an empty cell looks broken."""
    rows = [rrb.Horizontal(*views[first : first + columns]) for first in range(0, len(views), columns)]
    return rrb.Vertical(*rows) if len(rows) > 1 else rows[0]


def scale_name(grid: Grid) -> str:
    """Name of a scale of a cost volume in names of views."""
    return f"{grid.stride} px cells"


def legend(name: str, path: str) -> rrb.Spatial2DView:
    """A view of a legend, without a title bar."""
    return rrb.Spatial2DView(origin=f"/{path}", name=name, titlebar=False, background=colors.GROUND)


def point_legend(layout: Layout) -> rrb.Spatial2DView:
    """The legend of the overlays' points."""
    return legend(COLORED_BY[layout.contents.color], entities.LEGEND_POINTS)


def map_legends(*more: View) -> View:
    """The legends of displacements and certainties, and further ones, in one row."""
    return rrb.Horizontal(
        image_view("Displacement: hue = direction, white = none", entities.LEGEND_DISPLACEMENT),
        image_view("Probability, confidence", entities.LEGEND_CERTAINTY),
        *more,
    )


def with_legend(view: View, below: View, name: str) -> View:
    """A page with a legend at the bottom."""
    return rrb.Vertical(view, below, row_shares=[1.0 - LEGEND_SHARE, LEGEND_SHARE], name=name)


def curve_view(name: str, origin: str, *contents: str, highest: float | None = None) -> rrb.TimeSeriesView:
    """A view of curves over the frames: all below ``origin``, or those selected by the expressions in ``contents``.

    Without the viewer's own legend, which would lie over the curves' ends and have no room for all of them. All frames
    are shown; the viewer alone would show a thousand to either side of the one at hand. Ends are not given as numbers,
    since these would hold on the other timelines as well. It draws no tick at the last frame, so that legends name
    that, see `frames_named`.

    Args:
        name: name of the view.
        origin: parent entity of the curves.
        contents: expressions that select among them.
        highest: upper limit of the axis, above zero; None for an automatic one.
    """
    return rrb.TimeSeriesView(
        origin=origin,
        contents=list(contents) or "$origin/**",
        name=name,
        plot_legend=rrb.PlotLegend(visible=False),
        axis_x=rrb.TimeAxis(view_range=rr.TimeRange(start=TO_THE_END, end=TO_THE_END)),
        axis_y=None if highest is None else rrb.ScalarAxis(range=(0.0, highest)),
    )


def frames_named(layout: Layout) -> dict[str, colors.Rgb]:
    """An entry without a dot for the legend of curves, with the first and the last frame."""
    return span_named(*layout.frames) if layout.frames is not None and layout.several else {}


def span_named(first: int, last: int) -> dict[str, colors.Rgb]:
    """The same of frames by their numbers."""
    return {f"frames {first} to {last}": colors.GROUND}


def tensor_view(name: str, path: str, gamma: float = 1.0) -> rrb.TensorView:
    """A view of a cost volume as an image over ``(x, y)`` with sliders for ``(dy, dx)``; brighter for a small gamma."""
    return rrb.TensorView(
        origin=f"/{path}",
        name=name,
        slice_selection=rrb.TensorSliceSelection(width=3, height=2, slider=[0, 1]),
        scalar_mapping=rrb.TensorScalarMapping(colormap="viridis", mag_filter="nearest", gamma=gamma),
        view_fit="FillKeepAspectRatio",
    )


def uncapitalized(title: str) -> str:
    """A title for use within another, for instance ``"stage 3 (±5°/0.5 m)"``."""
    return title[0].lower() + title[1:]
