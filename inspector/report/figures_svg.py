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
MOST_LOG_TICKS = 10
DECADES, LOG_MARGIN = 4, 1.15
"""Largest number of powers of ten that a logarithmic axis spans, and the factor by which it goes beyond the values."""


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
    """Maps data to the drawing and draws the axes.

    Attributes:
        x_limits: limits of the plot.
        y_limits: likewise.
        log_x: whether the axis is logarithmic.
        log_y: likewise.
    """

    x_limits: tuple[float, float]
    y_limits: tuple[float, float]
    log_x: bool = False
    log_y: bool = False

    def x(self, value: float) -> float:
        """Horizontal position of a value."""
        return LEFT + (WIDTH - LEFT - RIGHT) * share(value, self.x_limits, self.log_x)

    def y(self, value: float) -> float:
        """Vertical position of a value; the drawing's y points down."""
        return HEIGHT - BOTTOM - (HEIGHT - TOP - BOTTOM) * share(value, self.y_limits, self.log_y)

    def frame(self, x_name: str, y_name: str, whole_x: bool = False, whole_y: bool = False) -> str:
        """Grid, numbers and names; ``whole_x`` and ``whole_y`` allow whole numbers only, for frames and counts."""
        parts = []
        for tick in log_ticks(*self.y_limits) if self.log_y else ticks(*self.y_limits, whole_y):
            parts += [_rule(self.y(tick), "grid"), _text(LEFT - 6, self.y(tick) + 4, f"{tick:g}", "end")]
        for tick in log_ticks(*self.x_limits) if self.log_x else ticks(*self.x_limits, whole_x):
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
    """A chart of values over frame numbers, with one line per series and a logarithmic axis.

    The start is often a hundred times as far off as the result, which a linear axis would squash onto zero.

    Args:
        title: title for screen readers.
        frames: ``[N]`` ascending frame numbers.
        series: series in drawing order, the last on top.
        unit: unit of the values, for the axis.
        spoken: gives a value with its unit, for tooltips.
    """
    first, last = min(frames), max(frames)
    x_limits = (first - 0.5, last + 0.5) if first == last else (float(first), float(last))
    axes = Axes(x_limits, log_limits(series), log_y=True)
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
    """A histogram of values over frames, with the same bins for all series, which overlap; its axis is logarithmic."""
    limits = log_limits(series)
    edges = np.geomspace(*limits, BINS + 1)
    counts = [np.histogram(np.clip(one.values, *limits), edges)[0] for one in series]
    axes = Axes(limits, (0.0, headroom(max(int(count.max()) for count in counts))), log_x=True)
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


def log_ticks(low: float, high: float) -> list[float]:
    """Values 1, 2 and 5 times a power of ten between two limits above zero; powers only if these are many.

    If there are fewer than two of them, the ticks are those of a linear axis.
    """
    powers = [10.0**power for power in range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)]
    fine = [factor * power for power in powers for factor in (1, 2, 5) if low <= factor * power <= high]
    if len(fine) < 2:
        return ticks(low, high)
    return fine if len(fine) <= MOST_LOG_TICKS else [power for power in powers if low <= power <= high]


def log_limits(series: Sequence[Series]) -> tuple[float, float]:
    """Limits of a logarithmic axis: a little beyond the values above zero, over at most `DECADES` powers of ten."""
    values = np.concatenate([one.values[one.values > 0.0] for one in series])
    if not len(values):
        return 0.1, 1.0
    highest = float(values.max())
    return max(float(values.min()), highest / 10.0**DECADES) / LOG_MARGIN, highest * LOG_MARGIN


def share(value: float, limits: tuple[float, float], logarithmic: bool) -> float:
    """How far along an axis a value lies, 0..1; on a logarithmic one, values below its lower limit lie at 0."""
    low, high = limits
    if logarithmic:
        value, low, high = math.log(max(value, low)), math.log(low), math.log(high)
    return (value - low) / (high - low)


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
