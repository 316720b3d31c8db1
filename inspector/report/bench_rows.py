"""The rows of `bench` as text, shared by terminal, CSV, Markdown and page."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

from calibnet.geometry import MiscalibrationRange

NOTHING = "–"
KINDS = ("rotation_deg", "translation_cm")
SHOWN = 4
"""Largest number of training rigs named per method."""
AXES = ("roll", "pitch", "yaw"), ("x", "y", "z")


@dataclass(frozen=True)
class Row:
    """A row of the table: a method, a range and a rig.

    Attributes:
        method: name of the method.
        range: range of the miscalibrations, for instance ``"5/0.5"``.
        rig: sensors and mount.
        known: whether the method was trained on that rig, in words.
        of: ``"frames"`` or ``"drives"``.
        figures: the row's figures in JSON.
    """

    method: str
    range: str
    rig: str
    known: str
    of: str
    figures: dict[str, Any]

    @property
    def label(self) -> str:
        """The range for people."""
        return MiscalibrationRange.parse(self.range).label

    @property
    def why(self) -> str:
        """Reason why there are no figures; empty if there are."""
        return str(self.figures.get("why", ""))

    def error(self, kind: str, statistic: str) -> float | None:
        """A statistic of ``rotation_deg`` or ``translation_cm``."""
        values = self.figures.get(kind)
        return None if values is None else float(values[statistic])

    def said(self, kind: str, statistic: str) -> str:
        """The statistic as text, with its unit."""
        value = self.error(kind, statistic)
        return NOTHING if value is None else f"{value:.2f}°" if kind == "rotation_deg" else f"{value:.1f} cm"

    @property
    def success(self) -> str:
        """Share of runs within 2° and 5 cm."""
        share = self.figures.get("success_2deg_5cm")
        return NOTHING if share is None else f"{share:.0%}"

    @property
    def refused(self) -> str:
        """Number of refused runs and of all runs."""
        return refused([self.figures])


def refused(figures: Iterable[dict[str, Any]]) -> str:
    """Numbers of refused and of all runs, and the number planned if the time limit was reached before."""
    measured = [one for one in figures if one.get("runs")]
    if not measured:
        return NOTHING
    runs = sum(one["runs"] for one in measured)
    planned = sum(one.get("of_runs", one["runs"]) for one in measured)
    said = f"{sum(one['refused'] for one in measured)} of {runs}"
    return said if planned == runs else f"{said} ({planned})"


def rows(content: dict[str, Any]) -> Iterator[Row]:
    """The rows of a bench by range, those on training rigs before the others."""
    found = [
        Row(name, row["range"], row.get("rig", ""), _known(entry, row), row.get("of", NOTHING), row)
        for name, entry in content["methods"].items()
        for row in entry["rows"]
    ]
    order = {range_: number for number, range_ in enumerate(content["ranges"])}
    yield from sorted(found, key=lambda row: order.get(row.range, len(order)))


def _known(entry: dict[str, Any], row: dict[str, Any]) -> str:
    """Whether the method was trained on the row's rig."""
    if row["in_rig"] is None:
        return NOTHING
    return "untrained" if entry["samples_trained"] == 0 else "known" if row["in_rig"] else "other"


def costs(entry: dict[str, Any]) -> dict[str, str]:
    """The costs of a method, by heading."""
    parameters, adds, ms = entry["parameters"], entry["multiply_adds"], entry["latency_ms"]
    samples, trained = entry["samples_trained"], entry["trained_on"]
    rigs = ", ".join(trained[:SHOWN]) + (f" and {len(trained) - SHOWN} more" if len(trained) > SHOWN else "")
    return {
        "parameters": NOTHING if parameters is None else f"{parameters / 1e6:.2f} M" if parameters else "none",
        "multiply-adds": NOTHING if adds is None else f"{adds / 1e9:.2f} G" if adds else "none",
        "a frame": NOTHING if ms is None else f"{ms:.0f} ms" if ms < 10_000 else f"{ms / 1000:.0f} s",
        "samples": NOTHING if samples is None else f"{samples:,}" if samples else "none",
        "trained on": rigs or ("no rig" if samples == 0 else NOTHING),
    }


def published_results(content: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    """The results that papers report, by method."""
    for name, entry in content["methods"].items():
        for result in entry["claims"]:
            yield name, result


def about(content: dict[str, Any]) -> str:
    """A sentence on the frames and settings of the measurement."""
    rigs = list(dict.fromkeys(one["rig"] for one in content["sequences"]))
    return (
        f"{_count(len(content['sequences']), 'sequence')} of {_count(len(rigs), 'rig')} ({'; '.join(rigs)}); "
        f"at most {content['most']} frames of each, {_count(content['repeats'], 'miscalibration')} per frame, "
        f"seed {content['seed']}; {_count(content['threads'], 'thread')}."
    )


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"


def as_csv(content: dict[str, Any]) -> str:
    """CSV with one line per row; missing figures are empty."""
    heads = ["method", "range", "rig", "in_rig", "of", "runs", "refused"]
    statistics = [
        (kind, name) for kind, axes in zip(KINDS, AXES, strict=True) for name in ("mean", "median", "p95", *axes)
    ]
    heads += [f"{kind}_{name}" for kind, name in statistics] + ["success_2deg_5cm", "success_1deg_2.5cm"]
    heads += ["parameters", "multiply_adds", "latency_ms", "samples_trained", "trained_on", "why"]
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(heads)
    for row in rows(content):
        entry, found = content["methods"][row.method], row.figures
        cells = [row.method, row.range, row.rig, found["in_rig"], row.of, found.get("runs"), found.get("refused")]
        cells += [row.error(kind, name) for kind, name in statistics]
        cells += [found.get("success_2deg_5cm"), found.get("success_1deg_2.5cm")]
        cells += [entry[key] for key in ("parameters", "multiply_adds", "latency_ms", "samples_trained")]
        table.writerow([*cells, "; ".join(entry["trained_on"]), row.why])
    return text.getvalue()
