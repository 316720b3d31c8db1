"""Tables as Markdown, for the viewer's text panels and for documents."""

from __future__ import annotations

from collections.abc import Container, Iterable, Sequence


def markdown_table(
    heads: Sequence[str], rows: Iterable[Sequence[str]], aligned_right: Container[str] = ()
) -> list[str]:
    """The lines of a table.

    Args:
        heads: of the columns.
        rows: a cell for each column.
        aligned_right: heads of the columns that are aligned to the right, as figures are; all others to the left.
    """
    ruler = "|".join("---:" if head in aligned_right else "---" for head in heads)
    return [_line(heads), f"|{ruler}|", *map(_line, rows)]


def _line(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"
