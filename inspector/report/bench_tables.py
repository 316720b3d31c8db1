"""The tables of `bench`, the most important first, and as Markdown."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from calibnet.geometry import MiscalibrationRange
from inspector.markdown import markdown_table
from inspector.report.bench_rows import AXES, KINDS, NOTHING, about, costs, published_results, rows
from inspector.report.bench_summary import LEGEND, summary

Table = tuple[list[str], list[list[str]]]
TITLE = "All methods on the same frames"
WORDS = frozenset(("method", "of", "rig", "trained there", "trained on", "measured on", "source", "range"))
"""Headings of columns with text; all others have figures."""


def short_tables(content: dict[str, Any]) -> Iterator[tuple[str, Table]]:
    """The main tables with their titles: one per range, the costs, and the results of the papers."""
    for range_ in content["ranges"]:
        yield f"From {_label(range_)}", summary(content, range_)
    yield "Cost and training data", _costs(content)
    yield "Results reported by the papers", _claims(content)


def long_tables(content: dict[str, Any]) -> Iterator[tuple[str, Table]]:
    """Tables by rig and axis, with their titles."""
    for range_ in content["ranges"]:
        yield f"From {_label(range_)}, by rig", _errors(content, range_)
        yield f"From {_label(range_)}, by axis: means of the absolute values", _axes(content, range_)


def as_markdown(content: dict[str, Any]) -> str:
    """All tables as Markdown for documents, with the long ones folded."""
    parts = ["<!-- Made by calib-inspect bench --from FILE --markdown FILE. -->", f"# {TITLE}", about(content), LEGEND]
    for title, table in short_tables(content):
        parts += [f"## {title}", _markdown(table)]
    parts.append("## Every rig and axis")
    for title, table in long_tables(content):
        parts += [f"<details><summary>{title}</summary>", _markdown(table), "</details>"]
    return "\n\n".join(parts) + "\n"


def _markdown(table: Table) -> str:
    heads, body = table
    return "\n".join(markdown_table(heads, body, set(heads) - WORDS))


def _label(range_: str) -> str:
    return MiscalibrationRange.parse(range_).label


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
        [row.method, row.rig, row.of, *(row.said(kind, name) for kind, name in names)]
        for row in rows(content)
        if row.range == range_ and not row.why
    ]
    return ["method", "rig", "of", *(axis for _, axis in names)], body


def _costs(content: dict[str, Any]) -> Table:
    body = [[name, *costs(entry).values()] for name, entry in content["methods"].items()]
    return ["method", "parameters", "multiply-adds", "a frame", "samples", "trained on"], body


def _claims(content: dict[str, Any]) -> Table:
    body = []
    for name, result in published_results(content):
        errors = f"{result['rotation_deg']:g}°", f"{result['translation_cm']:g} cm"
        body.append([name, result["range"], *errors, result["rig"], result["source"]])
    return ["method", "range", "rotation", "translation", "measured on", "source"], body
