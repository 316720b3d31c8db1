"""Static legends: what the colours of points, maps and frustums stand for."""

from __future__ import annotations

import numpy as np
import rerun as rr

from inspector import colors, entities
from inspector.observation import Layout

BAR_WIDTH, BAR_HEIGHT = 600, 8
WHEEL_RADIUS = 40
LEGEND_SPACING = 120.0
"""Between two names of the frustum legend, in its own units."""
LABELLED_DEPTHS_M = (3, 5, 10, 20, 40, 80)


def log_legends(rec: rr.RecordingStream, layout: Layout) -> None:
    """Log all legends once for the recording."""
    _log_depth_bar(rec)
    _log_displacement_wheel(rec)
    _log_camera_names(rec, layout)


def _log_depth_bar(rec: rr.RecordingStream) -> None:
    ratio = colors.FAR_M / colors.NEAR_M
    depth = colors.NEAR_M * ratio ** np.linspace(0.0, 1.0, BAR_WIDTH)
    bar = colors.depth_colors(np.tile(depth.astype(np.float32), (BAR_HEIGHT, 1)))
    rec.log(entities.LEGEND_DEPTH, rr.Image(bar), static=True)
    at = [BAR_WIDTH * np.log(metres / colors.NEAR_M) / np.log(ratio) for metres in LABELLED_DEPTHS_M]
    _log_labels(
        rec,
        f"{entities.LEGEND_DEPTH}/metres",
        [(x, BAR_HEIGHT / 2) for x in at],
        [f"{metres} m" for metres in LABELLED_DEPTHS_M],
        [colors.REFERENCE] * len(at),
    )


def _log_displacement_wheel(rec: rr.RecordingStream) -> None:
    offsets = np.arange(-WHEEL_RADIUS, WHEEL_RADIUS + 1)
    dx, dy = np.meshgrid(offsets, offsets)
    wheel = colors.flow_colors(np.stack([dx, dy], axis=-1), WHEEL_RADIUS)
    wheel[np.hypot(dx, dy) > WHEEL_RADIUS] = colors.EMPTY
    rec.log(entities.LEGEND_DISPLACEMENT, rr.Image(wheel), static=True)


def _log_camera_names(rec: rr.RecordingStream, layout: Layout) -> None:
    names = {"miscalibrated" if layout.has_reference else "start": colors.INITIAL}
    names |= {f"after stage {stage.number}": colors.STAGES[stage.number] for stage in layout.stages}
    if layout.has_reference:
        names["reference"] = colors.REFERENCE
    positions = [(LEGEND_SPACING * position, 0.0) for position in range(len(names))]
    _log_labels(rec, entities.LEGEND_STAGES, positions, list(names), list(names.values()))


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
