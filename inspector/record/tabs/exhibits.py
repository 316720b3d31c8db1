"""Tab *Inside*: pictures and curves that a method other than the cascade shows of its work.

They belong to `Part.VOLUMES`, like the cascade's maps. The method names them; this module knows no method.
"""

from __future__ import annotations

import cv2
import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from calibnet.exhibit import Exhibit
from inspector import colors
from inspector.record.contents import Contents, Part
from inspector.record.observation import Layout, Observation, StageLayout
from inspector.record.subtree import Subtree
from inspector.record.tabs.views import View, image_view

NAME = "Inside"

JPEG_QUALITY = 85
LARGEST = 1280
"""Largest side of a picture in pixels; larger ones are scaled down."""
COLUMNS = 2


def exhibit(stage: int, position: int) -> str:
    """Entity of a picture of a stage, by its position."""
    return f"stage_{stage}/inside/picture_{position}"


def curve(stage: int, position: int) -> str:
    """Entity of a curve of a stage, by its position."""
    return f"stage_{stage}/inside/curve_{position}"


def wanted(layout: Layout) -> bool:
    """Whether the method shows something, and it is recorded."""
    return any(map(_shown, layout.stages)) and Part.VOLUMES in layout.contents.parts


def log_once(rec: Subtree, layout: Layout) -> None:
    """Log nothing, since names are above the views."""


def log(rec: Subtree, observation: Observation, contents: Contents) -> None:
    """Log the pictures and the curves of every stage."""
    if Part.VOLUMES not in contents.parts:
        return
    for stage in observation.trace.stages:
        for position, shown in enumerate(stage.exhibits):
            rec.log(exhibit(stage.number, position), _picture(shown))
        for position, found in enumerate(stage.curves):
            rec.log(curve(stage.number, position), rr.BarChart(np.asarray(found.values, np.float32)))


def view(layout: Layout) -> View:
    """A page for every stage that shows something."""
    stages = [stage for stage in layout.stages if _shown(stage)]
    if len(stages) == 1:
        return _page(stages[0], layout, NAME)
    return rrb.Tabs(*(_page(stage, layout, stage.title) for stage in stages), name=NAME)


def _shown(stage: StageLayout) -> bool:
    return bool(stage.exhibits or stage.curves)


def _page(stage: StageLayout, layout: Layout, name: str) -> View:
    views: list[View] = [
        image_view(title, exhibit(stage.number, position)) for position, title in enumerate(stage.exhibits)
    ]
    views += [
        rrb.BarChartView(
            origin=f"/{curve(stage.number, position)}",
            name=title,
            plot_legend=rrb.PlotLegend(visible=False),
        )
        for position, title in enumerate(stage.curves)
    ]
    width, height = layout.image
    columns = 1 if width > COLUMNS * height and len(views) <= COLUMNS else min(COLUMNS, len(views))
    return rrb.Grid(*views, grid_columns=columns, name=name)


def _picture(shown: Exhibit) -> rr.EncodedImage | rr.Image:
    """A picture as it is; a map from dark (low) to bright (high), transparent where it has no value."""
    values = shown.picture
    if values.ndim == 3:
        scale = LARGEST / max(values.shape[:2])
        if scale < 1:
            values = np.asarray(cv2.resize(values, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA), np.uint8)
        return rr.Image(values).compress(jpeg_quality=JPEG_QUALITY)
    seen = np.isfinite(values)
    low, high = shown.limits or colors.robust_limits(np.asarray(values[seen]))
    painted = colors.map_colors(np.where(seen, values, low), low, high)
    painted[~seen] = colors.EMPTY
    return rr.Image(painted)
