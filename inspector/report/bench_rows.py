"""The table of `bench` as rows of text, which the terminal, CSV, Markdown and the page show alike."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from calibnet.geometry import MiscalibrationRange

NOTHING = "–"
KINDS = ("rotation_deg", "translation_cm")
AXES = ("roll", "pitch", "yaw"), ("x", "y", "z")


@dataclass(frozen=True)
class Row:
    """A line of the table: a method, a range and what it was measured on.

    Attributes:
        method: its name.
        range: for instance ``"5/0.5"``.
        rig: sensors and mount.
        known: whether the method was trained on that rig, in words.
        of: frames or drives.
        figures: what JSON has of it.
    """

    method: str
    range: str
    rig: str
    known: str
    of: str
    figures: dict[str, Any]

    @property
    def label(self) -> str:
        """The range as people write it."""
        return MiscalibrationRange.parse(self.range).label

    @property
    def why(self) -> str:
        """Why there are no figures; empty where there are."""
        return str(self.figures.get("why", ""))

    def error(self, kind: str, statistic: str) -> float | None:
        """A figure of ``rotation_deg`` or ``translation_cm``."""
        values = self.figures.get(kind)
        return None if values is None else float(values[statistic])

    def said(self, kind: str, statistic: str) -> str:
        """The same as text, with its unit."""
        value = self.error(kind, statistic)
        return NOTHING if value is None else f"{value:.2f}°" if kind == "rotation_deg" else f"{value:.1f} cm"

    @property
    def means(self) -> list[str]:
        """Mean errors."""
        return [self.said(kind, "mean") for kind in KINDS]

    @property
    def success(self) -> str:
        """Share of runs within 2° and 5 cm."""
        share = self.figures.get("success_2deg_5cm")
        return NOTHING if share is None else f"{share:.0%}"

    @property
    def refused(self) -> str:
        """Runs that were refused, of how many."""
        runs = self.figures.get("runs")
        return NOTHING if runs is None else f"{self.figures['refused']} of {runs}"


def rows(content: dict[str, Any]) -> Iterator[Row]:
    """The rows of a bench, by range, those in a known rig before the others."""
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
    """What a method costs, by heading."""
    parameters, adds, ms = entry["parameters"], entry["multiply_adds"], entry["latency_ms"]
    samples, trained = entry["samples_trained"], ", ".join(entry["trained_on"])
    return {
        "parameters": NOTHING if parameters is None else f"{parameters / 1e6:.2f} M" if parameters else "none",
        "multiply-adds": NOTHING if adds is None else f"{adds / 1e9:.2f} G" if adds else "none",
        "a frame": NOTHING if ms is None else f"{ms:.0f} ms" if ms < 10_000 else f"{ms / 1000:.0f} s",
        "samples": NOTHING if samples is None else f"{samples:,}" if samples else "none",
        "trained on": trained or ("no rig" if samples == 0 else NOTHING),
    }


def audit_cells(entry: dict[str, Any]) -> dict[str, str]:
    """Median rotation and translation with grey pictures and with those of another drive."""
    cells = {}
    for name in ("grey", "swapped"):
        row = entry["audit"].get(name)
        if row is None:
            cells[name] = NOTHING
        elif "why" in row:
            cells[name] = "refused"
        else:
            rotation, translation = row["rotation_deg"]["median"], row["translation_cm"]["median"]
            cells[name] = f"{rotation:.2f}° / {translation:.1f} cm"
    return cells


def claims(content: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    """What papers claim, by method."""
    for name, entry in content["methods"].items():
        for claim in entry["claims"]:
            yield name, claim


def about(content: dict[str, Any]) -> str:
    """What was measured on, in a sentence."""
    rigs = ", ".join(dict.fromkeys(one["rig"] for one in content["sequences"]))
    return (
        f"{len(content['sequences'])} sequences of {rigs}; at most {content['most']} frames of each, "
        f"{content['repeats']} miscalibration{'' if content['repeats'] == 1 else 's'} a frame, seed {content['seed']}; "
        f"{content['threads']} threads."
    )


def as_csv(content: dict[str, Any]) -> str:
    """A line a row; empty where there is no figure."""
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


def as_markdown(content: dict[str, Any]) -> str:
    """The page for documents."""
    lines = [
        "<!-- Made by calib-inspect bench --from FILE --markdown FILE. -->",
        "",
        "# All methods on the same frames",
    ]
    lines += ["", about(content), ""]
    for title, table in tables(content):
        lines += [f"## {title}", "", *_markdown(*table), ""]
    return "\n".join(lines)


Table = tuple[list[str], list[list[str]]]


def _errors(content: dict[str, Any], range_: str) -> Table:
    heads = ["method", "rig", "trained there", "of", "rotation, median", "p95", "translation, median", "p95"]
    heads += ["within 2° and 5 cm", "refused"]
    body = []
    for row in (one for one in rows(content) if one.range == range_):
        cells = [row.method, row.rig or NOTHING, row.known, row.of]
        if row.why:
            body.append([*cells, row.why, *[""] * 4, row.refused])
            continue
        figures = [row.said(kind, name) for kind in KINDS for name in ("median", "p95")]
        body.append([*cells, *figures, row.success, row.refused])
    return heads, body


def _axes(content: dict[str, Any], range_: str) -> Table:
    names = [(kind, axis) for kind, axes in zip(KINDS, AXES, strict=True) for axis in axes]
    body = [
        [row.method, row.rig, row.of, *(row.said(kind, name) for kind, name in names), *row.means]
        for row in rows(content)
        if row.range == range_ and not row.why
    ]
    return ["method", "rig", "of", *(axis for _, axis in names), "rotation, mean", "translation, mean"], body


def _costs(content: dict[str, Any]) -> Table:
    body = [[name, *costs(entry).values(), *audit_cells(entry).values()] for name, entry in content["methods"].items()]
    heads = ["method", "parameters", "multiply-adds", "a frame", "samples", "trained on"]
    return [*heads, "grey picture", "picture of another drive"], body


def _claims(content: dict[str, Any]) -> Table:
    def number(value: float | None, unit: str) -> str:
        return NOTHING if value is None else f"{value:g}{unit}"

    body = [
        [
            name,
            claim["range"],
            number(claim["rotation_deg"], "°"),
            number(claim["translation_cm"], " cm"),
            claim["rig"],
            claim["source"],
        ]
        for name, claim in claims(content)
    ]
    return ["method", "range", "rotation", "translation", "measured on", "says who"], body


def tables(content: dict[str, Any]) -> Iterator[tuple[str, Table]]:
    """All tables with their titles."""
    for range_ in content["ranges"]:
        label = MiscalibrationRange.parse(range_).label
        yield label, _errors(content, range_)
        yield f"{label}, per axis: mean of the absolute values", _axes(content, range_)
    yield "What they cost, and what they make of pictures that are not the scan's", _costs(content)
    yield "What the papers claim", _claims(content)


def _markdown(heads: list[str], body: list[list[str]]) -> list[str]:
    cells = ([cell.replace("|", "\\|") for cell in line] for line in (heads, ["---"] * len(heads), *body))
    return ["| " + " | ".join(line) + " |" for line in cells]
