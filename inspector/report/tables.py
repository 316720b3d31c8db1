"""The tables of the page: errors after every stage, in total and per axis."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape

from calibnet.geometry import MiscalibrationRange
from inspector.report.metrics import Figures, State
from inspector.report.verdict import ROTATION, TRANSLATION

STATISTICS, MORE = ("median", "p95"), ("mean", "std")
"""Statistics of both errors; narrow screens show the first two."""


def stages_table(figures: Figures) -> str:
    """Median, p95, mean and standard deviation of both errors and, with a reference, the success rates."""
    groups, heads = ["<th></th>"], ["<th>after</th>"]
    for kind in ("Rotation", "Translation"):
        groups += [f'<th class="group" colspan="2">{kind}</th>', '<th class="group more" colspan="2"></th>']
        heads += [f"<th>{name}</th>" for name in STATISTICS] + [f'<th class="more">{name}</th>' for name in MORE]
    if figures.has_reference:
        groups.append('<th class="group more" colspan="2">Frames within</th>')
        heads += ['<th class="more">2° and 5 cm</th>', '<th class="more">1° and 2.5 cm</th>']
    rows = []
    for state in figures.states:
        metrics = state.metrics
        cells = []
        for quantity, errors in ((ROTATION, metrics.rotation_deg), (TRANSLATION, metrics.translation_cm)):
            cells += [_cell(quantity.say(getattr(errors, name))) for name in STATISTICS]
            cells += [_cell(quantity.say(getattr(errors, name)), more=True) for name in MORE]
        if figures.has_reference:
            shares = (metrics.success_2deg_5cm, metrics.success_1deg_2_5cm)
            cells += [_cell(f"{share:.0%}", more=True) for share in shares]
        rows.append(_row(state, cells))
    return _table([groups, heads], rows)


def axes_table(figures: Figures) -> str:
    """A table of mean absolute values per axis, with one row per state."""
    heads = ["<th>after</th>"]
    heads += [f"<th>{name}</th>" for name in ("roll", "pitch", "yaw", "x (right)", "y (down)", "z (ahead)")]
    rows = []
    for state in figures.states:
        rotation, translation = state.metrics.rotation_deg, state.metrics.translation_cm
        cells = [_cell(ROTATION.say(angle)) for angle in (rotation.roll, rotation.pitch, rotation.yaw)]
        cells += [_cell(TRANSLATION.say(offset)) for offset in (translation.x, translation.y, translation.z)]
        rows.append(_row(state, cells))
    return _table([heads], rows)


def _row(state: State, cells: Iterable[str]) -> str:
    trained_for = ""
    if state.range is not None:
        trained_for = f' <span class="range">{escape(MiscalibrationRange.parse(state.range).label)}</span>'
    return f"<th>{state.name}{trained_for}</th>" + "".join(cells)


def _cell(text: str, more: bool = False) -> str:
    """A cell, which with ``more`` is left out on narrow screens."""
    return f'<td class="more">{text}</td>' if more else f"<td>{text}</td>"


def _table(heads: Iterable[Iterable[str]], rows: Iterable[str]) -> str:
    head = "".join(f"<tr>{''.join(cells)}</tr>" for cells in heads)
    body = "".join(f"<tr>{row}</tr>" for row in rows)
    return f'<table class="figures stages"><thead>{head}</thead><tbody>{body}</tbody></table>'
