"""Line charts and histograms as inline SVG, with units at the axes and colours from the page's style sheet."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from html import escape

import numpy as np

from calibnet.geometry.types import Floats

WIDTH, HEIGHT = 560, 250
LEFT, RIGHT, TOP, BOTTOM = 48, 10, 28, 40
"""Margins of the plot, for numbers on the left and names of the axes above and below."""
TICKS = 5
LINE_POINTS = 600
"""Largest number of points of a line; for more frames, it shows the extremes of neighbouring ones."""
MARKED_POINTS = 80
"""Largest number of frames that are drawn as dots with a tooltip."""
BINS = 24


@dataclass(frozen=True)
class Series:
    """One line or one set of bars.

    Attributes:
        name: name in tooltips.
        css: class of the style sheet with its colour.
        values: ``[N]``, in the unit of the axis.
    """

    name: str
    css: str
    values: Floats = field(repr=False)


@dataclass(frozen=True)
class Axes:
    """Maps data to the drawing and draws the axes; ``x_limits`` and ``y_limits`` are the limits of the plot."""

    x_limits: tuple[float, float]
    y_limits: tuple[float, float]

    def x(self, value: float) -> float:
        """Horizontal position of a value."""
        low, high = self.x_limits
        return LEFT + (WIDTH - LEFT - RIGHT) * (value - low) / (high - low)

    def y(self, value: float) -> float:
        """Vertical position of a value; the drawing's y points down."""
        low, high = self.y_limits
        return HEIGHT - BOTTOM - (HEIGHT - TOP - BOTTOM) * (value - low) / (high - low)

    def frame(self, x_name: str, y_name: str, whole_x: bool = False, whole_y: bool = False) -> str:
        """Grid, numbers and names; ``whole_x`` and ``whole_y`` allow whole numbers only, for frames and counts."""
        parts = []
        for tick in ticks(*self.y_limits, whole_y):
            parts += [_rule(self.y(tick), "grid"), _text(LEFT - 6, self.y(tick) + 4, f"{tick:g}", "end")]
        for tick in ticks(*self.x_limits, whole_x):
            parts.append(_text(self.x(tick), HEIGHT - BOTTOM + 16, f"{tick:g}", "middle"))
        parts += [
            _rule(self.y(self.y_limits[0]), "axis"),
            _text(8, 14, y_name, "start", "unit"),
            _text((LEFT + WIDTH - RIGHT) / 2, HEIGHT - 6, x_name, "middle", "unit"),
        ]
        return "".join(parts)


def line_chart(
    title: str, frames: Sequence[int], series: Sequence[Series], unit: str, spoken: Callable[[float], str]
) -> str:
    """A chart of values over frame numbers, with one line per series and an axis from zero.

    Args:
        title: title for screen readers.
        frames: ``[N]`` ascending frame numbers.
        series: series in drawing order, the last on top.
        unit: unit of the values, for the axis.
        spoken: gives a value with its unit, for tooltips.
    """
    first, last = min(frames), max(frames)
    highest = max(float(one.values.max()) for one in series)
    axes = Axes((first - 0.5, last + 0.5) if first == last else (first, last), (0.0, headroom(highest)))
    shapes = [axes.frame("frame", unit, whole_x=True)]
    for one in series:
        x, y = thinned(np.asarray(frames, dtype=np.float64), one.values)
        points = " ".join(f"{axes.x(a):.1f},{axes.y(b):.1f}" for a, b in zip(x, y, strict=True))
        marked = len(frames) <= MARKED_POINTS
        shapes.append(f'<polyline class="line {one.css}{"" if marked else " thin"}" points="{points}"/>')
        if marked:
            shapes += [
                f'<circle class="dot {one.css}" cx="{axes.x(a):.1f}" cy="{axes.y(b):.1f}" r="2.6">'
                f"<title>{escape(f'frame {a:g}, {one.name}: {spoken(b)}')}</title></circle>"
                for a, b in zip(x, y, strict=True)
            ]
    return _svg(title, shapes)


def histogram(title: str, series: Sequence[Series], x_name: str) -> str:
    """A histogram of values over frames, with the same bins for all series, which overlap."""
    highest = headroom(max(float(one.values.max()) for one in series))
    edges = np.linspace(0.0, highest, BINS + 1)
    counts = [np.histogram(one.values, edges)[0] for one in series]
    axes = Axes((0.0, highest), (0.0, headroom(max(int(count.max()) for count in counts))))
    shapes = [axes.frame(x_name, "frames", whole_y=True)]
    for one, count in zip(series, counts, strict=True):
        for low, high, number in zip(edges[:-1], edges[1:], count, strict=True):
            if number:
                left, right, top = axes.x(low) + 0.5, axes.x(high) - 0.5, axes.y(number)
                shapes.append(
                    f'<rect class="bar {one.css}" x="{left:.1f}" y="{top:.1f}" width="{right - left:.1f}" '
                    f'height="{axes.y(0.0) - top:.1f}"><title>'
                    f"{escape(f'{one.name}: {number} frames from {low:.3g} to {high:.3g}')}</title></rect>"
                )
    return _svg(title, shapes)


def ticks(low: float, high: float, whole: bool = False) -> list[float]:
    """Round numbers between two limits: about `TICKS` of them, 1, 2 or 5 times a power of ten apart."""
    raw = max((high - low) / TICKS, 1e-9)
    power = 10.0 ** math.floor(math.log10(raw))
    step = next(factor * power for factor in (1, 2, 5, 10) if factor * power >= 0.85 * raw)
    if whole:
        step = max(1.0, step)
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [round(index * step, 9) for index in range(first, last + 1)]


def headroom(highest: float) -> float:
    """Upper limit of an axis that starts at zero: a little above the highest value, and never zero."""
    return 1.06 * highest if highest > 0.0 else 1.0


def thinned(x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """At most `LINE_POINTS` points of a line, which keep every peak and every dip."""
    if len(x) <= LINE_POINTS:
        return x, y
    rows: list[int] = []
    for part in np.array_split(np.arange(len(x)), LINE_POINTS // 2):
        rows += sorted({int(part[y[part].argmin()]), int(part[y[part].argmax()])})
    return x[rows], y[rows]


def _rule(y: float, css: str) -> str:
    return f'<line class="{css}" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y:.1f}" y2="{y:.1f}"/>'


def _text(x: float, y: float, text: str, anchor: str, css: str = "number") -> str:
    return f'<text class="{css}" x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{escape(text)}</text>'


def _svg(title: str, shapes: Sequence[str]) -> str:
    name = escape(title, quote=True)
    return f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{name}">{"".join(shapes)}</svg>'
