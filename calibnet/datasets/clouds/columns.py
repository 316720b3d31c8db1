"""Clouds as named columns of numbers, read from bytes that are checked against the header."""

from __future__ import annotations

import io
from array import array
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibnet.runtime.reading import MEGABYTE

MOST_POINTS = 16_000_000
"""Largest number of points of a scan; scanners have up to 300,000 per turn."""
MOST_COLUMNS = 256
LONGEST_ROW, LONGEST_LINE = 4096, 64 * 1024
"""Largest number of bytes of a point, in binary and as text."""
LONGEST_WORD = 64
"""Largest number of characters of a number in a text file."""
MOST_BYTES = 256 * MEGABYTE
"""Largest size of a scan, in its file and unpacked."""
Columns = dict[str, NDArray[np.generic]]
"""Values ``[N]`` by name in lower case; of two columns with the same name the first counts."""


INTENSITY_NAMES = ("intensity", "reflectance", "reflectivity", "remission", "i")
"""Names under which clouds store intensity, best first, in lower case."""
SCALAR, UNNAMED_SCALAR = "scalar_", "scalar_field"
"""What CloudCompare puts before the names of a ``.ply``, and calls a column without a name: ``Scalar_field`` or
``scalar_Scalar_field``, and ``Scalar_field_#2`` for a second one."""


class CloudError(ValueError):
    """An error in a cloud, in words that continue a sentence; what to do follows after a semicolon, if known."""


@dataclass(frozen=True)
class Column:
    """One value of a point, or several.

    Attributes:
        name: name in lower case.
        dtype: type of one value.
        count: number of values; only single ones are kept, since others are padding or descriptors.
    """

    name: str
    dtype: np.dtype[np.generic]
    count: int = 1

    @property
    def size(self) -> int:
        """Size in bytes."""
        return self.dtype.itemsize * self.count


def check_table(columns: Sequence[Column], points: int) -> None:
    """Check that the layout in a header is plausible for a scan.

    Raises:
        CloudError: it is not.
    """
    if not 0 < len(columns) <= MOST_COLUMNS or any(column.count < 1 for column in columns):
        raise CloudError(f"its header names {len(columns)} columns")
    if sum(column.size for column in columns) > LONGEST_ROW:
        raise CloudError(f"its header states points of more than {LONGEST_ROW} bytes")
    if not 0 <= points <= MOST_POINTS:
        raise CloudError(f"its header states {_few(points)} points, but at most {MOST_POINTS:,} are read")


def from_rows(data: memoryview, columns: Sequence[Column], points: int, alone: bool = True) -> Columns:
    """Read binary data, point by point.

    Args:
        data: bytes after the header.
        columns: columns of the table.
        points: number of points in the header.
        alone: whether nothing else may follow.

    Raises:
        CloudError: there are fewer or more bytes than stated.
    """
    check_table(columns, points)
    row = sum(column.size for column in columns)
    check_length(len(data), points * row, points, alone)
    offsets = np.cumsum([0, *(column.size for column in columns)])
    single = _single(columns)
    layout = np.dtype(
        {
            "names": list(single),
            "formats": [columns[place].dtype for place in single.values()],
            "offsets": [int(offsets[place]) for place in single.values()],
            "itemsize": row,
        }
    )
    table = np.frombuffer(data[: points * row], layout)
    return {name: table[name] for name in single}


def from_columns(data: bytearray, columns: Sequence[Column], points: int) -> Columns:
    """Read binary data of the right length, column by column, as in a compressed ``.pcd``."""
    ends = np.cumsum([0, *(column.size * points for column in columns)])
    return {
        name: np.frombuffer(data, columns[place].dtype, points, int(ends[place]))
        for name, place in _single(columns).items()
    }


def from_text(data: bytes, columns: Sequence[Column], points: int, alone: bool = True) -> Columns:
    """Read text with one point per line, ignoring empty lines.

    Raises:
        CloudError: there are too few or too many lines, or a line has too few or too many numbers, or a word.
    """
    check_table(columns, points)
    width = sum(column.count for column in columns)
    starts = np.cumsum([0, *(column.count for column in columns)])
    kept = [(name, int(starts[place]), array("d")) for name, place in _single(columns).items()]
    file, number = io.BytesIO(data), 0
    while number < points and (line := file.readline(LONGEST_LINE)):
        if not (words := line.split()):
            continue
        number += 1
        if len(words) != width:
            raise CloudError(f"point {number:,} of {points:,} has {len(words)} numbers instead of {width}")
        for name, place, values in kept:
            try:
                values.append(float(words[place][:LONGEST_WORD]))
            except ValueError:
                raise CloudError(f"point {number:,} has a {name[:40]!r} that is not a number") from None
    check_length(number + len(file.read().split(b"\n", 2)) - 1, points, points, alone)
    return {name: np.frombuffer(values, np.float64) for name, _, values in kept}


def check_length(found: int, promised: int, points: int, alone: bool) -> None:
    """Check an amount of data against the header; a few bytes too many are allowed.

    Raises:
        CloudError: it is less, or much more.
    """
    if found < promised:
        raise CloudError(f"it is truncated: its header states {points:,} points")
    if alone and found > promised + max(promised // max(points, 1), 1):
        raise CloudError(f"it has more than the {points:,} points in its header")


def whole_number(text: str) -> int:
    """A count in a header.

    Raises:
        CloudError: it is not a whole number.
    """
    if not (text.isascii() and text.isdecimal()):
        raise CloudError(f"its header has {text[:40]!r} instead of a whole number")
    return int(text[:20])


def _single(columns: Sequence[Column]) -> dict[str, int]:
    """Indices of the columns with a single value, by name."""
    places: dict[str, int] = {}
    for place, column in enumerate(columns):
        if column.count == 1:
            places.setdefault(column.name, place)
    return places


def _few(number: int) -> str:
    return f"{number:,}" if abs(number) < 10**15 else "a huge number of"


def points_of(columns: Columns) -> NDArray[np.float32]:
    """Points ``[N, 4]`` from columns by name, with intensity 0 if there is none.

    Raises:
        CloudError: a coordinate is missing.
    """
    if missing := [axis for axis in "xyz" if axis not in columns]:
        raise CloudError(f"it has no column {', '.join(missing)} (its columns: {', '.join(columns) or 'none'})")
    intensity = intensity_name(columns)
    return joined(columns["x"], columns["y"], columns["z"], None if intensity is None else columns[intensity])


def intensity_name(names: Iterable[str]) -> str | None:
    """The name in lower case of the column that holds intensity; None if there is none.

    If CloudCompare wrote a single column without a name, it is intensity, as that of a text file without names is.
    """
    names = list(names)
    known = (f"{prefix}{name}" for name in INTENSITY_NAMES for prefix in ("", SCALAR))
    unnamed = [name for name in names if name.startswith((UNNAMED_SCALAR, SCALAR + UNNAMED_SCALAR))]
    return next((name for name in known if name in names), unnamed[0] if len(unnamed) == 1 else None)


def joined(
    x: NDArray[np.generic], y: NDArray[np.generic], z: NDArray[np.generic], intensity: NDArray[np.generic] | None
) -> NDArray[np.float32]:
    """Points ``[N, 4]`` from single columns, with intensity 0 if there is none."""
    points = np.zeros((len(x), 4), np.float32)
    with np.errstate(over="ignore"):  # too large values become infinite, and are dropped
        for place, values in enumerate((x, y, z) if intensity is None else (x, y, z, intensity)):
            points[:, place] = values
    return points
