"""The tables of `bench` as an HTML page, in the style of a report."""

from __future__ import annotations

from html import escape
from typing import Any

from inspector.report.bench_rows import about
from inspector.report.bench_summary import LEGEND
from inspector.report.bench_tables import TITLE, long_tables, short_tables
from inspector.report.template import html_page, stylesheet

STYLE = """
main { max-width: 1360px; }
td, th { text-align: left; vertical-align: top; padding: 4px 14px 4px 0; }
td:last-child { white-space: normal; min-width: 26ch; }
summary { cursor: pointer; font-weight: 600; }
"""


def page(content: dict[str, Any]) -> str:
    """The HTML page of the content of a ``bench --json`` file."""
    sections = [_section(title, *table) for title, table in short_tables(content)]
    sections += [_section(title, *table, folded=True) for title, table in long_tables(content)]
    header = f'<h1>{TITLE}</h1>\n<p class="about">{escape(about(content))}</p>\n<p>{escape(LEGEND)}</p>'
    return html_page(
        TITLE, "Camera–LiDAR calibration: methods compared", header, "\n".join(sections), stylesheet() + STYLE
    )


def _section(title: str, heads: list[str], body: list[list[str]], folded: bool = False) -> str:
    head = "".join(f"<th>{escape(cell)}</th>" for cell in heads)
    lines = "\n".join(f"<tr>{_cells(line)}</tr>" for line in body)
    table = f'<div class="wide"><table><thead><tr>{head}</tr></thead><tbody>\n{lines}\n</tbody></table></div>'
    if folded:
        return f"<section><details><summary>{escape(title)}</summary>\n{table}\n</details></section>"
    return f"<section>\n<h2>{escape(title)}</h2>\n{table}\n</section>"


def _cells(line: list[str]) -> str:
    """The cells of a row; empty cells are merged with the one before, which holds a sentence."""
    cells: list[tuple[str, int]] = []
    for text in line:
        if text or not cells:
            cells.append((text, 1))
        else:
            cells[-1] = (cells[-1][0], cells[-1][1] + 1)
    first, *rest = cells
    spans = [f'<td colspan="{wide}">' if wide > 1 else "<td>" for _, wide in rest]
    others = "".join(f"{span}{escape(text)}</td>" for span, (text, _) in zip(spans, rest, strict=True))
    return f"<th>{escape(first[0])}</th>{others}"
