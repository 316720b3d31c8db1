"""The tables of the page: errors after every stage, in all and per axis."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape

from calibnet.geometry import MiscalibrationRange
from inspector.report.metrics import Figures, State
from inspector.report.verdict import ROTATION, TRANSLATION

STATISTICS = ("mean", "median", "std", "p95")


def stages_table(figures: Figures) -> str:
    """Mean, median, standard deviation and p95 of both errors and, with a reference, the success rates."""
    groups = ["<th></th>"]
    groups += [f'<th class="group" colspan="{len(STATISTICS)}">{name}</th>' for name in ("Rotation", "Translation")]
    heads = ["<th>after</th>", *(f"<th>{name}</th>" for name in STATISTICS * 2)]
    if figures.has_reference:
        groups.append('<th class="group" colspan="2">Frames within</th>')
        heads += ["<th>2° and 5 cm</th>", "<th>1° and 2.5 cm</th>"]
    rows = []
    for state in figures.states:
        metrics = state.metrics
        cells = [ROTATION.say(getattr(metrics.rotation_deg, name)) for name in STATISTICS]
        cells += [TRANSLATION.say(getattr(metrics.translation_cm, name)) for name in STATISTICS]
        if figures.has_reference:
            cells += [f"{share:.0%}" for share in (metrics.success_2deg_5cm, metrics.success_1deg_2_5cm)]
        rows.append(_row(state, cells))
    return _table([groups, heads], rows)


def axes_table(figures: Figures) -> str:
    """Mean absolute values on each axis, one row a state."""
    heads = ["<th>after</th>"]
    heads += [f"<th>{name}</th>" for name in ("roll", "pitch", "yaw", "x (right)", "y (down)", "z (ahead)")]
    rows = []
    for state in figures.states:
        rotation, translation = state.metrics.rotation_deg, state.metrics.translation_cm
        cells = [ROTATION.say(angle) for angle in (rotation.roll, rotation.pitch, rotation.yaw)]
        cells += [TRANSLATION.say(offset) for offset in (translation.x, translation.y, translation.z)]
        rows.append(_row(state, cells))
    return _table([heads], rows)


def _row(state: State, cells: Iterable[str]) -> str:
    trained_for = ""
    if state.range is not None:
        trained_for = f' <span class="range">{escape(MiscalibrationRange.parse(state.range).label)}</span>'
    return f"<th>{state.name}{trained_for}</th>" + "".join(f"<td>{cell}</td>" for cell in cells)


def _table(heads: Iterable[Iterable[str]], rows: Iterable[str]) -> str:
    head = "".join(f"<tr>{''.join(cells)}</tr>" for cells in heads)
    body = "".join(f"<tr>{row}</tr>" for row in rows)
    return f'<table class="figures"><thead>{head}</thead><tbody>{body}</tbody></table>'
