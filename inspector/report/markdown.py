"""Tables as Markdown."""

from __future__ import annotations

from collections.abc import Sequence

WORDS = frozenset(("method", "of", "rig", "without", "trained there", "trained on", "measured on", "says who", "range"))
"""Heads of columns that are read and not compared: they stand to the left."""


def markdown_table(heads: Sequence[str], body: Sequence[Sequence[str]]) -> str:
    """A table, figures to the right."""
    marks = "|".join("---" if head in WORDS else "---:" for head in heads)
    return "\n".join([_line(heads), f"|{marks}|", *map(_line, body)])


def _line(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"
