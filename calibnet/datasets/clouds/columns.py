"""A cloud as named columns of numbers, cut from bytes that are held against what a header promises."""

from __future__ import annotations

import io
from array import array
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibnet.runtime.reading import MEGABYTE

MOST_POINTS = 16_000_000
"""Points of one scan; a scanner gives 300,000 a turn."""
MOST_COLUMNS = 256
LONGEST_ROW, LONGEST_LINE = 4096, 64 * 1024
"""Bytes of one point, binary and as text."""
LONGEST_WORD = 64
"""Characters of a number in a text file that are read."""
MOST_BYTES = 256 * MEGABYTE
"""Largest scan, in its file and unpacked."""
Columns = dict[str, NDArray[np.generic]]
"""Values ``[N]`` by name, in lower case; of a name given twice the first counts."""


INTENSITY_NAMES = ("intensity", "reflectance", "reflectivity", "scalar_intensity", "scalar_reflectance", "i")
"""Names under which clouds store intensity, best first, in lower case."""


class CloudError(ValueError):
    """What is wrong with a cloud, in words that continue a sentence; after a semicolon what to do, if that is known."""


@dataclass(frozen=True)
class Column:
    """One value of a point, or ``count`` of them.

    Attributes:
        name: in lower case.
        dtype: of one value.
        count: values; only single ones are kept, the others are padding or descriptors.
    """

    name: str
    dtype: np.dtype[np.generic]
    count: int = 1

    @property
    def size(self) -> int:
        """Bytes."""
        return self.dtype.itemsize * self.count


def check_table(columns: Sequence[Column], points: int) -> None:
    """Hold the layout that a header promises against what a scan can be.

    Raises:
        CloudError: it is nothing of the kind.
    """
    if not 0 < len(columns) <= MOST_COLUMNS or any(column.count < 1 for column in columns):
        raise CloudError(f"its header names {len(columns)} columns")
    if sum(column.size for column in columns) > LONGEST_ROW:
        raise CloudError(f"its header promises points of more than {LONGEST_ROW} bytes")
    if not 0 <= points <= MOST_POINTS:
        raise CloudError(f"its header promises {_few(points)} points, and {MOST_POINTS:,} are the most that are read")


def from_rows(data: memoryview, columns: Sequence[Column], points: int, alone: bool = True) -> Columns:
    """Binary data, point after point.

    Args:
        data: what follows the header.
        columns: of the table.
        points: that the header promises.
        alone: nothing else may follow.

    Raises:
        CloudError: there are fewer bytes than promised, or more.
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
    """Binary data, column after column, as a compressed ``.pcd`` has it; its length is right already."""
    ends = np.cumsum([0, *(column.size * points for column in columns)])
    return {
        name: np.frombuffer(data, columns[place].dtype, points, int(ends[place]))
        for name, place in _single(columns).items()
    }


def from_text(data: bytes, columns: Sequence[Column], points: int, alone: bool = True) -> Columns:
    """Text, one point a line; empty lines do not count.

    Raises:
        CloudError: a line is missing, too many, too short or too long, or holds a word.
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
                raise CloudError(f"point {number:,} has a {name[:40]!r} that is no number") from None
    check_length(number + len(file.read().split(b"\n", 2)) - 1, points, points, alone)
    return {name: np.frombuffer(values, np.float64) for name, _, values in kept}


def check_length(found: int, promised: int, points: int, alone: bool) -> None:
    """Hold an amount of data against what a header promises; a few bytes too many are no damage.

    Raises:
        CloudError: it is less, or much more.
    """
    if found < promised:
        raise CloudError(f"it is truncated, its header promises {points:,} points")
    if alone and found > promised + max(promised // max(points, 1), 1):
        raise CloudError(f"it holds more than the {points:,} points that its header promises")


def whole_number(text: str) -> int:
    """A count of a header.

    Raises:
        CloudError: it is none.
    """
    if not (text.isascii() and text.isdecimal()):
        raise CloudError(f"its header says {text[:40]!r} where a whole number should be")
    return int(text[:20])


def _single(columns: Sequence[Column]) -> dict[str, int]:
    """Places of the columns with one value, by name."""
    places: dict[str, int] = {}
    for place, column in enumerate(columns):
        if column.count == 1:
            places.setdefault(column.name, place)
    return places


def _few(number: int) -> str:
    return f"{number:,}" if abs(number) < 10**15 else "a huge number of"


def points_of(columns: Columns) -> NDArray[np.float32]:
    """``[N, 4]`` of columns by name; intensity 0 where there is none.

    Raises:
        CloudError: a coordinate is missing.
    """
    if missing := [axis for axis in "xyz" if axis not in columns]:
        raise CloudError(f"it has no column {', '.join(missing)}, only {', '.join(columns) or 'none'}")
    intensity = next((columns[name] for name in INTENSITY_NAMES if name in columns), None)
    return joined(columns["x"], columns["y"], columns["z"], intensity)


def joined(
    x: NDArray[np.generic], y: NDArray[np.generic], z: NDArray[np.generic], intensity: NDArray[np.generic] | None
) -> NDArray[np.float32]:
    """``[N, 4]`` of single columns; without an intensity that is 0."""
    points = np.zeros((len(x), 4), np.float32)
    with np.errstate(over="ignore"):  # what is too large becomes infinite, and is dropped as such
        for place, values in enumerate((x, y, z) if intensity is None else (x, y, z, intensity)):
            points[:, place] = values
    return points
