"""Legends of the colours of points and maps, and of names in colours; each is logged once."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from inspector import colors, entities
from inspector.record.contents import Coloring
from inspector.record.pictures.lettering import bar_png, names_png
from inspector.record.subtree import Subtree

BAR_WIDTH = 1800
POINT_BAR_HEIGHT, CERTAINTY_BAR_HEIGHT = 54, 140
"""Heights in pixels of a bar across a whole page, and of one across a third of it."""
NAMES_HEIGHT = 64
WHEEL_RADIUS = 40
LABELLED_CERTAINTIES = (0.0, 0.05, 0.2, 0.5, 1.0)


class Bar(NamedTuple):
    """A strip of colours ``[BAR_WIDTH, 3]``, and the labels on it by their position, 0..1."""

    strip: NDArray[np.uint8]
    labels: dict[float, str]


def log_point_legend(rec: Subtree, coloring: Coloring) -> None:
    """Log the legend of the points' colours, at `entities.LEGEND_POINTS`."""
    _log_bar(rec, entities.LEGEND_POINTS, point_bar(coloring), POINT_BAR_HEIGHT)


def log_map_legends(rec: Subtree) -> None:
    """Log the legends of maps, at `entities.LEGEND_DISPLACEMENT` and `entities.LEGEND_CERTAINTY`."""
    rec.log_once(entities.LEGEND_DISPLACEMENT, rr.Image(displacement_wheel()))
    certainty = colors.certainty_colors(np.linspace(0.0, 1.0, BAR_WIDTH) ** 2)
    bar = Bar(certainty, {c**0.5: f"{c:g}" for c in LABELLED_CERTAINTIES})
    _log_bar(rec, entities.LEGEND_CERTAINTY, bar, CERTAINTY_BAR_HEIGHT)


def log_decided_legend(rec: Subtree, with_truth: bool) -> None:
    """Log the legend of the maps of how decided cells are, at `entities.LEGEND_DECIDED`."""
    strip = colors.map_colors(np.linspace(0.0, 1.0, BAR_WIDTH), 0.0, 1.0)
    low, brighten, high = "undecided: all displacements alike", "the hourglass should brighten", "decided: one has all"
    if with_truth:
        low, high = "undecided, none on the truth", "decided, all on the truth"
        brighten += "; no colour: the truth is beyond its window"
    labels = {0.0: low, 0.5: brighten, 1.0: high}
    bar = Bar(strip, labels)
    _log_bar(rec, entities.LEGEND_DECIDED, bar, POINT_BAR_HEIGHT)


def log_names(rec: Subtree, path: str, names: Mapping[str, colors.Rgb]) -> None:
    """Log names in a row, each after a dot in its colour."""
    picture = names_png(list(names.items()), NAMES_HEIGHT)
    rec.log_once(path, rr.EncodedImage(contents=picture, media_type="image/png"))


def point_bar(coloring: Coloring) -> Bar:
    """The legend of the colours of an overlay's points."""
    share = np.linspace(0.0, 1.0, BAR_WIDTH)
    if coloring is Coloring.INTENSITY:
        strip = colors.map_colors(share, 0.0, 1.0)
        return Bar(strip, {0.0: "weak return of the laser", 0.5: "intensity", 1.0: "strong"})
    if coloring is Coloring.EDGE:
        strip = np.where(share[:, None] < 0.5, colors.EDGE, colors.REST).astype(np.uint8)
        return Bar(
            strip, {0.25: "points at depth edges, which should lie on outlines in the image", 0.75: "all others"}
        )
    if coloring is Coloring.ERROR:
        labels = {px / colors.WORST_PX: f"{px} px off" for px in (0, 5, 10, 15)} | {
            1.0: f"{colors.WORST_PX:g} px or more"
        }
        return Bar(colors.error_colors(colors.WORST_PX * share), labels)
    ratio = colors.FAR_M / colors.NEAR_M
    strip = colors.depth_colors((colors.NEAR_M * ratio**share).astype(np.float32))
    places = np.log(np.array(colors.LABELLED_DEPTHS_M) / colors.NEAR_M) / np.log(ratio)
    return Bar(strip, dict(zip(places.tolist(), (f"{metres} m" for metres in colors.LABELLED_DEPTHS_M), strict=True)))


def displacement_wheel() -> NDArray[np.uint8]:
    """``[H, W, 3]``: the colour of every direction and length of a displacement."""
    offsets = np.arange(-WHEEL_RADIUS, WHEEL_RADIUS + 1)
    dx, dy = np.meshgrid(offsets, offsets)
    wheel = colors.flow_colors(np.stack([dx, dy], axis=-1), WHEEL_RADIUS)
    wheel[np.hypot(dx, dy) > WHEEL_RADIUS] = colors.EMPTY
    return wheel


def _log_bar(rec: Subtree, path: str, bar: Bar, height: int) -> None:
    picture = bar_png(bar.strip, bar.labels, height)
    rec.log_once(path, rr.EncodedImage(contents=picture, media_type="image/png"))
