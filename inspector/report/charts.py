"""The charts of the page, whose series have the colours of the viewer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from inspector import colors
from inspector.colors import Rgb
from inspector.report.figures_svg import Series, histogram, line_chart
from inspector.report.metrics import Figures, State
from inspector.report.verdict import ROTATION, TRANSLATION, Quantity

ON_PAPER = 0.8
"""Brightness of the series' colours on white, where those for the viewer's dark background are too pale."""


def charts(figures: Figures) -> str:
    """Curves over the frames and histograms; nothing for a single frame."""
    if len(figures.run.frames) == 1:
        return ""
    what = figures.measure
    ends = [figures.initial, figures.corrected]
    curves = [_curve(figures, quantity, what) for quantity in (ROTATION, TRANSLATION)]
    bars = [_bars(ends, quantity, what) for quantity in (ROTATION, TRANSLATION)]
    return (
        f"<section><h2>{what} over the frames</h2>{_legend(figures.states)}"
        f'<div class="two">{"".join(curves)}</div></section>'
        f"<section><h2>How the frames are distributed</h2>{_legend(ends)}"
        f'<div class="two">{"".join(bars)}</div></section>'
    )


def _curve(figures: Figures, quantity: Quantity, what: str) -> str:
    frames = [frame.index for frame in figures.run.frames]
    series = [_series(state, quantity) for state in figures.states]
    svg = line_chart(f"{quantity.name}: {what.lower()} over the frames", frames, series, quantity.axis, quantity.say)
    return f'<div class="chart"><h3>{quantity.name}</h3>{svg}</div>'


def _bars(states: Sequence[State], quantity: Quantity, what: str) -> str:
    series = [_series(state, quantity) for state in states]
    svg = histogram(f"{quantity.name}: how many frames have which {what.lower()}", series, quantity.axis)
    return f'<div class="chart"><h3>{quantity.name}</h3>{svg}</div>'


def _series(state: State, quantity: Quantity) -> Series:
    return Series(state.name, _css(state), state.rotation_deg if quantity is ROTATION else state.translation_cm)


def _legend(states: Sequence[State]) -> str:
    final = states[-1].number
    items = (
        f'<li><i class="{_css(state)}"></i>{state.name}{" = corrected" if final and state.number == final else ""}</li>'
        for state in states
    )
    return f'<ul class="legend">{"".join(items)}</ul>'


def series_styles(states: Sequence[State]) -> dict[str, str]:
    """Parts for `page.css`: ``colors`` on white, ``dark_colors``, and the ``series`` that use them."""
    palette = {_css(state): _color(state) for state in states}
    series = (
        f"svg .line.{css} {{ stroke: var(--{css}); }} svg .dot.{css}, .legend .{css} {{ fill: var(--{css}); "
        f"background: var(--{css}); }} svg .bar.{css} {{ fill: var(--{css}); stroke: var(--{css}); }}"
        for css in palette
    )
    return {
        "colors": _variables({css: _darker(color) for css, color in palette.items()}),
        "dark_colors": _variables(palette),
        "series": "\n".join(series),
    }


def _variables(palette: Mapping[str, Rgb]) -> str:
    return "\n".join(f"  --{css}: rgb{color};" for css, color in palette.items())


def _darker(color: Rgb) -> Rgb:
    red, green, blue = (round(ON_PAPER * channel) for channel in color)
    return red, green, blue


def _color(state: State) -> Rgb:
    return colors.INITIAL if state.number is None else colors.STAGES[state.number]


def _css(state: State) -> str:
    return "initial" if state.number is None else f"stage-{state.number}"
