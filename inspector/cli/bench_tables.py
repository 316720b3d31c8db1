"""What `bench` prints: the tables of the page, as narrow as a terminal is."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from calibnet.geometry import MiscalibrationRange
from inspector.report.bench_rows import KINDS, NOTHING, about, audit_cells, claims, costs, rows

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table


def print_bench(content: dict[str, Any], console: Console) -> None:
    """A table a range, one of costs, and the claims of papers line by line."""
    console.print(about(content), soft_wrap=True)
    letters = {rig: chr(ord("A") + number % 26) for number, rig in enumerate(_rigs(content))}
    for rig, letter in letters.items():
        console.print(f"Rig {letter}: {rig}", soft_wrap=True)
    console.print("* The method was trained on this rig.")
    for range_ in content["ranges"]:
        console.print(_errors(content, range_, letters))
    for row in rows(content):
        if row.why:
            console.print(f"{row.method}, {row.label}: {row.why}", soft_wrap=True, style="yellow")
    console.print(_costs(content))
    console.print(_audit(content))
    for name, claim in claims(content):
        errors = f"{claim['rotation_deg']:g}° / {claim['translation_cm']:g} cm"
        console.print(
            f"{name} claims {errors} from {claim['range']} on {claim['rig']} ({claim['source']}).", soft_wrap=True
        )


def _rigs(content: dict[str, Any]) -> list[str]:
    return list(dict.fromkeys(one["rig"] for one in content["sequences"]))


def _errors(content: dict[str, Any], range_: str, letters: dict[str, str]) -> Table:
    table = _table(f"{MiscalibrationRange.parse(range_).label}, median and 95th percentile")
    table.add_column("rig", no_wrap=True)
    for head in ("degrees", "cm", "2°, 5 cm", "refused"):
        table.add_column(head, justify="right", no_wrap=True)
    for row in rows(content):
        if row.range == range_:
            errors = [_pair(row.error(kind, "median"), row.error(kind, "p95")) for kind in KINDS]
            known = "*" if row.known == "known" else " "
            where = f"{letters.get(row.rig, '')}{known} {row.of}" if row.rig else ""
            table.add_row(row.method, where, *errors, row.success, row.refused)
    return table


def _pair(median: float | None, p95: float | None) -> str:
    return NOTHING if median is None or p95 is None else f"{median:.2f} / {p95:.2f}"


def _costs(content: dict[str, Any]) -> Table:
    table = _table("What they cost")
    for head in ("parameters", "multiply-adds", "a frame", "samples"):
        table.add_column(head, justify="right", no_wrap=True)
    for name, entry in content["methods"].items():
        told = costs(entry)
        told.pop("trained on")
        table.add_row(name, *told.values())
    return table


def _audit(content: dict[str, Any]) -> Table:
    table = _table("Medians with pictures that are not the scan's")
    for head in ("grey picture", "picture of another drive"):
        table.add_column(head, justify="right", no_wrap=True)
    for name, entry in content["methods"].items():
        table.add_row(name, *audit_cells(entry).values())
    return table


def _table(title: str) -> Table:
    from rich import box
    from rich.table import Table

    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column("method", no_wrap=True)
    return table
