"""Tables that `bench` prints: those of its HTML page, narrow enough for a terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from calibnet.geometry import MiscalibrationRange
from inspector.report.bench_rows import KINDS, NOTHING, about, costs, published_results, rows
from inspector.report.bench_summary import ERRORS, IMAGES, LEGEND, summary

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table


def print_bench(content: dict[str, Any], console: Console) -> None:
    """Print a row per method for each range, a row per rig, the costs, and the figures of the papers."""
    console.print(about(content), LEGEND, sep="\n")
    for range_ in content["ranges"]:
        for title, heads in (("mean errors", ERRORS), ("with images that do not belong to the scan", IMAGES)):
            table = _summary(content, range_, title, heads)
            if len(table.columns) > 2:
                console.print(table)
    letters = {rig: chr(ord("A") + number % 26) for number, rig in enumerate(_rigs(content))}
    for rig, letter in letters.items():
        console.print(f"Rig {letter}: {rig}")
    console.print("* The method was trained on this rig.")
    for range_ in content["ranges"]:
        console.print(_errors(content, range_, letters))
    for row in rows(content):
        if row.why:
            console.print(f"{row.method}, {row.label}: {row.why}", style="yellow")
    console.print(_costs(content))
    published = list(published_results(content))
    if published:
        console.print("Published elsewhere, on other frames:")
    for name, result in published:
        errors = f"{result['rotation_deg']:g}° / {result['translation_cm']:g} cm"
        console.print(f"{name}: {errors} from {result['range']} on {result['rig']} ({result['source']}).")


def _rigs(content: dict[str, Any]) -> list[str]:
    return list(dict.fromkeys(one["rig"] for one in content["sequences"]))


def _errors(content: dict[str, Any], range_: str, letters: dict[str, str]) -> Table:
    table = _table(
        f"From {MiscalibrationRange.parse(range_).label} by rig: median and 95th percentile; runs within 2° and 5 cm"
    )
    table.add_column("rig", no_wrap=True)
    for head in ("degrees", "cm", "2°, 5 cm"):
        table.add_column(head, justify="right", no_wrap=True)
    for row in rows(content):
        if row.range == range_:
            errors = [_pair(row.error(kind, "median"), row.error(kind, "p95")) for kind in KINDS]
            known = "*" if row.known == "known" else " "
            where = f"{letters.get(row.rig, '')}{known} {row.of}" if row.rig else ""
            table.add_row(row.method, where, *errors, row.success)
    return table


def _pair(median: float | None, p95: float | None) -> str:
    if median is None or p95 is None:
        return NOTHING
    return " / ".join(f"{value:.{2 if value < 10 else 1}f}" for value in (median, p95))


def _costs(content: dict[str, Any]) -> Table:
    table = _table("Cost")
    for head in ("parameters", "multiply-adds", "a frame", "samples"):
        table.add_column(head, justify="right", no_wrap=True)
    for name, entry in content["methods"].items():
        told = costs(entry)
        told.pop("trained on")
        table.add_row(name, *told.values())
    return table


def _summary(content: dict[str, Any], range_: str, title: str, chosen: tuple[str, ...]) -> Table:
    heads, body = summary(content, range_)
    table = _table(f"From {MiscalibrationRange.parse(range_).label}, {title}")
    kept = [k for k in range(1, len(heads)) if heads[k] == "of" or heads[k] in chosen]
    for k in kept:
        table.add_column(heads[k], justify="left" if heads[k] == "of" else "right")
    for line in body:
        if any(line[k] != NOTHING for k in kept[1:]):
            table.add_row(line[0], *(line[k] for k in kept))
    return table


def _table(title: str) -> Table:
    from rich import box
    from rich.table import Table

    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column("method", no_wrap=True)
    return table
