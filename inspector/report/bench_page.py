"""The table of `bench` as a page of its own, in the looks of a report."""

from __future__ import annotations

from html import escape
from typing import Any

from inspector.report.bench_rows import about, tables
from inspector.report.page import stylesheet

_PAGE = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="generator" content="calib-inspect">
<title>All methods on the same frames</title>
<link rel="icon" href="data:,">
<style>
{style}
table.figures td, table.figures th {{ text-align: left; vertical-align: top; }}
</style>
</head>
<body>
<main>
<header>
<p class="kind">Camera–LiDAR calibration: methods compared</p>
<h1>All methods on the same frames, from the same miscalibrations</h1>
<p class="about">{about}</p>
<p>“Known” is a rig that the method was trained on, “other” one that it never saw. What a method can do with a grey
picture, or with that of another drive, it does not read off the picture.</p>
</header>
{sections}
</main>
</body>
</html>
"""


def page(content: dict[str, Any]) -> str:
    """The page of what ``bench --json`` wrote."""
    sections = [_section(title, heads, body) for title, (heads, body) in tables(content)]
    return _PAGE.format(style=stylesheet(), about=escape(about(content)), sections="\n".join(sections))


def _section(title: str, heads: list[str], body: list[list[str]]) -> str:
    head = "".join(f"<th>{escape(cell)}</th>" for cell in heads)
    lines = "\n".join(f"<tr>{_cells(line)}</tr>" for line in body)
    table = f'<table class="figures"><thead><tr>{head}</tr></thead><tbody>\n{lines}\n</tbody></table>'
    return f'<section>\n<h2>{escape(title)}</h2>\n<div class="wide">{table}</div>\n</section>'


def _cells(line: list[str]) -> str:
    """The cells of a line; empty ones belong to the one before, which has a sentence."""
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
