"""Clouds as text (``.csv``, ``.xyz`` and others), with one point per line and column names in a line before them."""

from __future__ import annotations

import io
import re
from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from calibnet.datasets.clouds.bin import DECLARE as SAY
from calibnet.datasets.clouds.columns import LONGEST_LINE, LONGEST_WORD, CloudError, Columns, intensity_name
from calibnet.datasets.clouds.tables import read_table
from calibnet.runtime.text import one_line

TEXT_SUFFIXES = (".csv", ".txt", ".xyz", ".asc", ".pts")
SEPARATORS = (";", "\t", ",")
"""Separators of columns other than blanks; with another separator, a comma may be a decimal point."""
COMMENTS = ("#", "//", "%")
MOST_LINES_BEFORE = 1000
"""Largest number of lines before the first point."""
METRES = {**dict.fromkeys(("m", "meter", "meters", "metre", "metres"), 1.0), "cm": 0.01, "mm": 0.001}
UNIT = re.compile(r"(.+?)(?:\s*[\[(]([^\])]*)[\])]|_?(mm|cm|m))")
"""A name with a unit: ``X (mm)``, ``x_m``."""
AXIS = re.compile(r"points?(?:_m_xyz)?:([012])|(?:pos_?|coord_?|points?_?)?([xyz])1?")
"""Names of axes, in lower case and without a unit. VeloView writes ``Points_m_XYZ:0``, Ouster ``X1`` for the first
return."""
UNNAMED = {3: ("x", "y", "z"), 4: ("x", "y", "z", "intensity")}
"""Columns without names, by their number."""
DECLARE = f"name them in its first line, or {SAY}"


class _Head(NamedTuple):
    """The head of a file, before the points.

    Attributes:
        names: names of the columns; None if there are none.
        metres: unit of the positions in metres.
        start: offset of the first point.
        separator: separator of columns; None for blanks.
        width: number of columns.
    """

    names: tuple[str, ...] | None
    metres: float
    start: int
    separator: str | None
    width: int


def read_text(data: bytes, layout: tuple[str, ...] | None = None) -> Columns:
    """Positions and intensity of a text file.

    Columns are named by a line before the points (or a comment, as in CloudCompare's files), or by ``layout``; three or
    four columns without names are x, y, z and intensity.

    Args:
        data: content of the file.
        layout: names of the columns, for a file that does not name them.

    Raises:
        CloudError: columns have no names, or a point lacks a number or has a word.
    """
    from pyarrow import csv

    head = _head(data)
    names = head.names or layout or UNNAMED.get(head.width)
    if names is None:
        raise CloudError(f"its {head.width} columns have no names; {DECLARE}")
    places = {name.lower(): place for place, name in reversed(list(enumerate(names)))}
    intensity = intensity_name(places)
    wanted = {name: str(places[name]) for name in (*"xyz", intensity) if name in places}
    body = data[head.start :]
    if head.separator is None:
        body = b"\n".join(b",".join(line.split()) for line in body.splitlines())
    read = partial(
        csv.read_csv,
        read_options=csv.ReadOptions(use_threads=False, column_names=list(map(str, range(len(names))))),
        parse_options=csv.ParseOptions(delimiter=head.separator or ","),
        convert_options=csv.ConvertOptions(
            decimal_point="," if head.separator not in (None, ",") and b"," in body else ".",
            column_types=dict.fromkeys(wanted.values(), "float64"),
            include_columns=list(wanted.values()),
        ),
    )
    table = read_table(read, body)
    columns: Columns = {
        name: np.asarray(table[place], np.float64) * (head.metres if name in "xyz" else 1.0)
        for name, place in wanted.items()
    }
    if head.names is None and layout is None:
        _check_positions(columns)
    return columns


def _head(data: bytes) -> _Head:
    """Read up to the first point.

    Raises:
        CloudError: there is none, or the lines before it do not name columns.
    """
    names: tuple[str, ...] | None = None
    metres = 1.0
    file = io.BytesIO(data)
    for _ in range(MOST_LINES_BEFORE):
        start = file.tell()
        raw = file.readline(LONGEST_LINE)
        if not raw:
            break
        line = raw.decode("utf-8-sig", "replace").strip()
        text = line.lstrip("".join(COMMENTS)).strip()
        separator = next((one for one in SEPARATORS if one in text), None)
        words = [word.strip().strip('"') for word in text.split(separator)]
        is_comment = line.startswith(COMMENTS)
        if not text or (not is_comment and len(words) == 1 and words[0].isdecimal()):
            continue  # the number of points, first in a .pts file and after the names in one of CloudCompare
        if not is_comment and (names is not None or all(_is_number(word, separator) for word in words)):
            return _Head(names, metres, start, separator, len(words))
        called = tuple(_called(word)[0] for word in words)
        if set("xyz") <= set(called):
            names, metres = called, _metres(words)
        elif not is_comment:
            raise CloudError(f"its first line ({one_line(text, 80)}) does not name columns x, y and z; {DECLARE}")
    raise CloudError("it has no points")


def _called(word: str) -> tuple[str, str]:
    """The standard name of a column, and its unit if it states one."""
    word = word.lower()
    unit = UNIT.fullmatch(word)
    for name, of in (((unit[1], unit[2] or unit[3] or "") if unit else (word, "")), (word, "")):
        if (match := AXIS.fullmatch(name)) is not None:
            return match[2] or "xyz"[int(match[1])], of
    return (unit[1] if unit and unit[2] is not None else word), ""


def _metres(words: Sequence[str]) -> float:
    """The unit of x, y and z in metres.

    Raises:
        CloudError: it is not one of `METRES`, or not the same for all.
    """
    units = {unit or "m" for name, unit in map(_called, words) if name in ("x", "y", "z")}
    if len(units) > 1 or not units <= METRES.keys():
        raise CloudError(f"its x, y and z are in {', '.join(sorted(units))[:60]}; write metres")
    return METRES[units.pop()]


def _is_number(word: str, separator: str | None) -> bool:
    try:
        float(word[:LONGEST_WORD].replace(",", "." if separator else ",") or "nan")
    except ValueError:
        return False
    return True


def _check_positions(columns: Columns) -> None:
    """Check that none of three columns without names is a counter, such as a ring number.

    Raises:
        CloudError: only one of them has whole numbers.
    """
    whole = [axis for axis in "xyz" if _is_whole(columns[axis])]
    if whole and len(whole) < 3:
        place = "xyz".index(whole[0]) + 1
        raise CloudError(f"its columns have no names, and column {place} has only whole numbers; {DECLARE}")


def _is_whole(values: Sequence[float] | np.ndarray) -> bool:
    known = np.asarray(values)[np.isfinite(values)]
    return bool(len(known) and (known == np.round(known)).all())
