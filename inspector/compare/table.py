"""The text panel of a comparison: figures of every run, differences from the first, and differing settings."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from calibnet.evaluation.metrics import Metrics
from calibnet.geometry import PoseError, degrees_and_cm, pose_error
from calibnet.methods.registry import CASCADE
from inspector.compare.comparison import ComparedRun, Comparison
from inspector.markdown import markdown_table
from inspector.record.tabs.table import NOTHING

RECORD_KEYS = ("samples", "minutes", "commit", "interim")
"""Keys of a training record that tell weights apart."""
UNCOMPARED = ("detail", "parts", "color")
"""Settings that affect what is shown but not what is computed."""

Column = tuple[str, Callable[[Metrics], float], Callable[[float], str]]


def _degrees(value: float) -> str:
    return f"{value:.2f}°"


def _centimetres(value: float) -> str:
    return f"{value:.1f} cm"


def _percent(value: float) -> str:
    return f"{100 * value:.0f} %"


COLUMNS: tuple[Column, ...] = (
    ("rotation", lambda metrics: metrics.rotation_deg.median, _degrees),
    ("p95", lambda metrics: metrics.rotation_deg.p95, _degrees),
    ("translation", lambda metrics: metrics.translation_cm.median, _centimetres),
    ("p95", lambda metrics: metrics.translation_cm.p95, _centimetres),
    ("< 2° and < 5 cm", lambda metrics: metrics.success_2deg_5cm, _percent),
    ("< 1° and < 2.5 cm", lambda metrics: metrics.success_1deg_2_5cm, _percent),
)


def comparison_table(comparison: Comparison) -> str:
    """Markdown of errors, distances between results, and the settings that differ."""
    known = [run.corrected is not None for run in comparison.runs]
    lines = [*_drives(comparison), ""] if comparison.drives else []
    lines += [*_errors(comparison), ""] if any(known) else []
    if not all(known):
        lines += ["*Runs without a reference have no errors.*", ""]
    lines += [
        f"### Distance of each frame's result from that of {comparison.first.name}",
        "",
        *_distances(comparison),
        "",
    ]
    return "\n".join([*lines, "### Settings that differ", "", *_settings(comparison), ""])


def _drives(comparison: Comparison) -> list[str]:
    """Each run's result for the whole drive: verdict, error and uncertainty."""
    first, with_errors = comparison.first, any(run.run.drive_error for run in comparison.runs)
    off = ["error"] if with_errors else []
    of_first = first.run.drive
    away = [] if of_first is None else [f"distance from {first.name}"]
    rows = []
    for run in comparison.runs:
        drive, verdict = run.run.drive, run.run.drive_verdict
        row = [f"**{run.name}**", _word(run)]
        row += [_pair(run.run.drive_error) for _ in off]
        if of_first is not None:
            row.append(_pair(None if drive is None or run is first else pose_error(drive, of_first)))
        sure = None if verdict is None or verdict.covariance is None else verdict
        row.append(NOTHING if sure is None else degrees_and_cm(sure.sigma_rotation_deg, sure.sigma_translation_cm))
        rows.append(row)
    return ["### Whole drive as one", "", *markdown_table(["", "verdict", *off, *away, "uncertainty (1σ)"], rows)]


def _word(run: ComparedRun) -> str:
    if run.run.drive is None:
        return "not solved"
    return NOTHING if run.run.drive_verdict is None else run.run.drive_verdict.word


def _pair(error: PoseError | None) -> str:
    return NOTHING if error is None else f"{_degrees(error.rotation_deg)} / {_centimetres(error.translation_cm)}"


def _errors(comparison: Comparison) -> list[str]:
    first, count = comparison.first, len(comparison.indices)
    if comparison.one_start:
        rows = [["start of all", *_figures(first.initial, None)]]
    else:
        rows = [[f"{run.name}, at the start", *_figures(run.initial, None)] for run in comparison.runs]
    rows += [
        [f"**{run.name}**", *_figures(run.corrected, None if run is first else first.corrected)]
        for run in comparison.runs
    ]
    return [
        f"### Errors of each frame alone, over {count} frame{'' if count == 1 else 's'}",
        "",
        *markdown_table(["", *(name for name, _, _ in COLUMNS)], rows),
        "",
        f"Medians and 95th percentiles (p95); in brackets, the difference from **{first.name}**.",
    ]


def _figures(metrics: Metrics | None, other: Metrics | None) -> list[str]:
    """One cell per column, with the difference from ``other`` where there is one."""
    if metrics is None:
        return [NOTHING] * len(COLUMNS)
    cells = []
    for _, value, say in COLUMNS:
        cell = say(value(metrics))
        change = 0.0 if other is None else value(metrics) - value(other)
        if say(abs(change)) != say(0.0):
            cell += f" ({'−' if change < 0 else '+'}{say(abs(change)).removesuffix(' cm')})"
        cells.append(cell)
    return cells


def _distances(comparison: Comparison) -> list[str]:
    rows = [[run.name, *_figures(run.distance(comparison.first), None)[:4]] for run in comparison.runs[1:]]
    return [*markdown_table(["", *(name for name, _, _ in COLUMNS[:4])], rows), "", "Medians, and 95th percentiles."]


def _settings(comparison: Comparison) -> list[str]:
    described = [_described(run) for run in comparison.runs]
    names = list(dict.fromkeys(name for settings in described for name in settings))
    rows = []
    for name in names:
        values = [str(settings.get(name, NOTHING)) for settings in described]
        if len(set(values)) > 1:
            rows.append([name, *values])
    return markdown_table(["", *(run.name for run in comparison.runs)], rows) if rows else ["Nothing."]


def _described(run: ComparedRun) -> dict[str, Any]:
    """Settings, versions and weights of a run, by names for people."""
    settings = {"method": CASCADE} | {k: value for k, value in run.run.settings.items() if k not in UNCOMPARED}
    versions = {f"version of {name}": value for name, value in run.run.provenance.items()}
    weights = {
        f"weights of stage {number}": ", ".join(f"{key} {record[key]}" for key in RECORD_KEYS if key in record)
        for number, record in run.run.weights.items()
    }
    return {**settings, **weights, **versions}
