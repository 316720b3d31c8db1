"""Tables as Markdown, for the viewer's text panels and for documents."""

from __future__ import annotations

from collections.abc import Container, Iterable, Sequence


def markdown_table(
    heads: Sequence[str], rows: Iterable[Sequence[str]], aligned_right: Container[str] = ()
) -> list[str]:
    """The lines of a Markdown table.

    Args:
        heads: headings of the columns.
        rows: rows of the table, with a cell for each column.
        aligned_right: headings of the columns that are aligned to the right, such as figures.
    """
    ruler = "|".join("---:" if head in aligned_right else "---" for head in heads)
    return [_line(heads), f"|{ruler}|", *map(_line, rows)]


def _line(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"
