"""Static legends: what the colours of points, maps and frustums stand for."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from inspector import colors, entities
from inspector.record.contents import Coloring, Part
from inspector.record.observation import Layout

BAR_WIDTH, BAR_HEIGHT = 1200, 12
WHEEL_RADIUS = 40
LEGEND_SPACING = 120.0
"""Between two names of the frustum legend, in its own units."""
LABELLED_DEPTHS_M = (3, 5, 10, 20, 40, 80)
LABELLED_CERTAINTIES = (0.0, 0.05, 0.2, 0.5, 1.0)


class Bar(NamedTuple):
    """A strip of colours ``[BAR_WIDTH, 3]`` and the labels on it by their place, 0..1."""

    strip: NDArray[np.uint8]
    labels: dict[float, str]


def log_legends(rec: rr.RecordingStream, layout: Layout) -> None:
    """Log all legends that something in the recording needs, once for the recording."""
    _log_bar(rec, entities.LEGEND_POINTS, point_bar(layout.contents.color))
    if Part.VOLUMES in layout.contents.parts:
        _log_displacement_wheel(rec)
        certainty = colors.certainty_colors(np.linspace(0.0, 1.0, BAR_WIDTH) ** 2)
        _log_bar(rec, entities.LEGEND_CERTAINTY, Bar(certainty, {c**0.5: f"{c:g}" for c in LABELLED_CERTAINTIES}))
        marks = {"now": colors.INITIAL, "won": colors.FOUND}
        _log_names(rec, entities.LEGEND_WINDOW, marks | ({"true": colors.REFERENCE} if layout.has_reference else {}))
    if Part.SCENE in layout.contents.parts:
        _log_camera_names(rec, layout)


def point_bar(coloring: Coloring) -> Bar:
    """What the colours of an overlay's points stand for."""
    share = np.linspace(0.0, 1.0, BAR_WIDTH)
    if coloring is Coloring.INTENSITY:
        strip = colors.map_colors(share, 0.0, 1.0)
        return Bar(strip, {0.0: "weak return of the laser", 0.5: "intensity", 1.0: "strong"})
    if coloring is Coloring.EDGE:
        strip = np.where(share[:, None] < 0.5, colors.EDGE, colors.REST).astype(np.uint8)
        return Bar(strip, {0.25: "points at depth edges: they must lie on outlines in the picture", 0.75: "all others"})
    if coloring is Coloring.ERROR:
        labels = {px / colors.WORST_PX: f"{px} px off" for px in (0, 5, 10, 15)} | {
            1.0: f"{colors.WORST_PX:g} px or more"
        }
        return Bar(colors.error_colors(colors.WORST_PX * share), labels)
    ratio = colors.FAR_M / colors.NEAR_M
    strip = colors.depth_colors((colors.NEAR_M * ratio**share).astype(np.float32))
    places = np.log(np.array(LABELLED_DEPTHS_M) / colors.NEAR_M) / np.log(ratio)
    return Bar(strip, dict(zip(places.tolist(), (f"{metres} m" for metres in LABELLED_DEPTHS_M), strict=True)))


def _log_bar(rec: rr.RecordingStream, path: str, bar: Bar) -> None:
    rec.log(path, rr.Image(np.tile(bar.strip, (BAR_HEIGHT, 1, 1))), static=True)
    positions = [(BAR_WIDTH * place, 0.0) for place in bar.labels]
    _log_labels(rec, f"{path}/labels", positions, list(bar.labels.values()), [colors.REFERENCE] * len(positions))


def _log_displacement_wheel(rec: rr.RecordingStream) -> None:
    offsets = np.arange(-WHEEL_RADIUS, WHEEL_RADIUS + 1)
    dx, dy = np.meshgrid(offsets, offsets)
    wheel = colors.flow_colors(np.stack([dx, dy], axis=-1), WHEEL_RADIUS)
    wheel[np.hypot(dx, dy) > WHEEL_RADIUS] = colors.EMPTY
    rec.log(entities.LEGEND_DISPLACEMENT, rr.Image(wheel), static=True)


def _log_camera_names(rec: rr.RecordingStream, layout: Layout) -> None:
    names = {layout.start.lower(): colors.INITIAL}
    names |= {f"after stage {stage.number}": colors.STAGES[stage.number] for stage in layout.stages}
    if layout.has_reference:
        names["reference"] = colors.REFERENCE
    _log_names(rec, entities.LEGEND_STAGES, names)


def _log_names(rec: rr.RecordingStream, path: str, names: dict[str, colors.Rgb]) -> None:
    """Names in their colours, in a row."""
    positions = [(LEGEND_SPACING * position, 0.0) for position in range(len(names))]
    _log_labels(rec, path, positions, list(names), list(names.values()))


def _log_labels(
    rec: rr.RecordingStream,
    path: str,
    positions: list[tuple[float, float]],
    labels: list[str],
    label_colors: list[colors.Rgb],
) -> None:
    rec.log(
        path,
        rr.Points2D(positions, labels=labels, colors=label_colors, radii=rr.Radius.ui_points(5.0), show_labels=True),
        static=True,
    )
