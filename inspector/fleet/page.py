"""The page of a fleet: its cars and all drives, worst first, in one HTML file beside the table."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from importlib import resources
from pathlib import Path
from string import Template
from urllib.parse import quote

from calibnet.runtime.text import number_of, one_line
from calibnet.runtime.writing import Kind, write_whole
from calibnet.verdict import APART
from inspector.fleet.history import History, histories
from inspector.fleet.ledger import joint_verdicts, word_counts
from inspector.fleet.table import FAILED, ORDER, TABLE, Row, severity, worst_first
from inspector.report.files import PAGE, result_picture
from inspector.report.template import html_page, stylesheet

MOST_ROWS, MOST_CARS = 1000, 300
"""Largest number of drives and mounts on the page, since browsers slow down with more; all are in the table."""
GRADES = {"accepted": "good", "cannot tell": "fair", APART: "apart", "rejected": "bad", FAILED: "none"}
UNCERTAINTY = "± (1σ)"
HEADS = ("car", "drive", "date", "verdict", "moved", UNCERTAINTY, "by its car", "frames", "why", "picture")
LONGEST_REASON = 120
"""Characters of a reason that are shown at once, so that the worst ten drives fit on a screen; the rest unfolds."""


def write_page(rows: Sequence[Row], folder: Path) -> Path:
    """Write the page of a fleet beside its table.

    Args:
        rows: rows of the table.
        folder: the fleet's folder.

    Returns:
        The page.
    """
    page = make_page(rows, folder)
    write_whole(folder / PAGE, page.encode(errors="backslashreplace"), Kind.PAGE)
    return folder / PAGE


def make_page(rows: Sequence[Row], folder: Path) -> str:
    """The HTML of the page, with links relative to the folder."""
    cars, worst = histories(rows), worst_first(rows)
    names = {car.car for car in cars}
    headline = f"{number_of(len(rows), 'drive')} of {number_of(len(names), 'car')}: {word_counts(rows)}"
    about = f"{joint_verdicts(rows)} {_moved(len({car.car for car in cars if car.moves}))}".strip()
    sections = Template(_resource("page.html")).substitute(
        cars="\n".join(_car(car) for car in cars[:MOST_CARS]),
        more_cars=_more(len(cars), MOST_CARS, "mounts"),
        heads="".join(_head(name) for name in HEADS),
        rows="\n".join(_row(row, folder) for row in worst[:MOST_ROWS]),
        more_rows=_more(len(worst), MOST_ROWS, "drives"),
        table=f'<a href="{TABLE}">{TABLE}</a>',
    )
    return html_page(
        f"Fleet: {headline}",
        "Fleet of camera–LiDAR calibrations",
        f'<h1>{escape(headline)}</h1>\n<p class="about">{escape(about)}</p>',
        sections,
        stylesheet() + _resource("page.css"),
        _resource("page.js"),
    )


def _resource(name: str) -> str:
    return resources.files(__package__).joinpath(name).read_text(encoding="utf-8")


def _moved(cars: int) -> str:
    if not cars:
        return "No mount was found to have moved between drives."
    return f"{'1 car has a mount' if cars == 1 else f'{cars} cars have a mount'} that moved between drives."


def _car(car: History) -> str:
    after = {move.after.folder for move in car.moves}
    squares = "".join(_square(row, row.folder in after) for row in car.rows)
    text = escape(one_line(car.sentence))
    return f'<li><b>{escape(car.name)}</b><span class="strip">{squares}</span><span>{text}</span></li>'


def _square(row: Row, moved: bool) -> str:
    css = GRADES[row.word] + (" moved" if moved else "")
    title = escape(f"{row.drive} {row.date[:10]}: {row.word}")
    if not row.report:
        return f'<span class="{css}" title="{title}"></span>'
    return f'<a class="{css}" href="{_link(row.report)}" title="{title}" aria-label="{title}"></a>'


def _head(name: str) -> str:
    return f'<th><button type="button">{name}</button></th>' if name not in ("", "picture") else f"<th>{name}</th>"


def _row(row: Row, folder: Path) -> str:
    drive = escape(f"{row.drive}, camera {row.camera}" if row.camera else row.drive)
    linked = f'<a href="{_link(row.report)}">{drive}</a>' if row.report else drive
    of_frames = row.recording and row.frames  # that of a failed drive has only the reason
    recording = f'<br><a class="about" href="{_link(row.recording)}">recording</a>' if of_frames else ""
    cause = f"<br>{escape(row.cause)}" if row.cause else ""
    alone = f'<br><span class="about">by its car; alone: {row.verdict}</span>' if row.word != row.verdict else ""
    used = f"{row.frames}" + (f"<br>{row.skipped} skipped" if row.skipped else "")
    cells = [
        f"<td>{escape(row.car)}</td>",
        f"<td>{linked}{recording}</td>",
        f"<td>{escape(row.date[:10])}</td>",
        f'<td class="word {GRADES[row.word]}" data-key="{ORDER.index(row.word)}">{row.word}{cause}{alone}</td>',
        _pair("moved", row.moved_deg, row.moved_cm, severity(row)),
        _pair(UNCERTAINTY, row.sigma_deg, row.sigma_cm, row.sigma_deg or 0.0),
        _pair("by its car", row.by_car_moved_deg, row.by_car_moved_cm, row.by_car_moved_deg or 0.0),
        f'<td class="number" data-key="{row.frames}" data-head="frames">{used}</td>',
        f'<td class="reason">{_reasons(row)}</td>',
        f"<td>{_picture(row, folder)}</td>",
    ]
    return f"<tr>{''.join(cells)}</tr>"


def _reasons(row: Row) -> str:
    """The beginning of the reason for the drive's word; its rest and the reason for the other verdict unfold."""
    reason, other, whose = row.reason, row.by_car_reason, "By its car"
    if row.word != row.verdict:
        reason, other, whose = other, reason, "Alone"
    whole = one_line(reason)
    end = len(whole)
    if end > LONGEST_REASON:
        end = max(whole.rfind(" ", 0, LONGEST_REASON), 0) or LONGEST_REASON
    rest = escape(whole[end:].strip())
    if other:
        rest += f'<br><span class="about">{whose}: {escape(one_line(other))}</span>'
    start = escape(whole[:end])
    return f"<details><summary>{start} …</summary>{rest}</details>" if rest else start


def _pair(head: str, degrees: float | None, centimetres: float | None, key: float) -> str:
    """A cell with rotation and translation, and the key by which it is sorted."""
    if degrees is None or centimetres is None:
        return '<td class="number" data-key=""></td>'
    text = f"{degrees:.2f}°<br>{centimetres:.1f} cm"
    return f'<td class="number" data-key="{key:.4f}" data-head="{head}">{text}</td>'


def _picture(row: Row, folder: Path) -> str:
    """A small picture of the report."""
    file = result_picture(folder / row.folder) if row.report else None
    if file is None:
        return ""
    picture = f'<img loading="lazy" src="{_link(f"{row.folder}/{file}")}" alt="Points over a frame">'
    return f'<a href="{_link(row.report)}">{picture}</a>'


def _link(path: str) -> str:
    """A path relative to the page as a URL; names that are quoted already are quoted once more."""
    return escape(quote(path))


def _more(count: int, shown: int, what: str) -> str:
    return f'<p class="about">{count - shown} more {what} are in the table.</p>' if count > shown else ""
