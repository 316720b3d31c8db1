"""``.bin`` clouds: rows of float32 numbers, in a file that does not state the number of columns."""

from __future__ import annotations

from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from calibnet.datasets.clouds.columns import CloudError, Columns

KITTI = ("x", "y", "z", "intensity")
LAYOUTS: tuple[tuple[str, ...], ...] = (
    KITTI,
    ("x", "y", "z"),
    (*KITTI, "ring"),
    (*KITTI, "ring", "time"),
)
"""Layouts that are recognised, the most common first; includes KITTI's, and nuScenes's with five columns."""
FLOAT_BYTES = 4
DECLARE = "name them in calibration.yaml, for instance 'cloud_columns: [x, y, z, intensity, ring]'"
LEVELS = 32
"""Number of classes of values, of equal size, by which columns are distinguished."""
ENOUGH_VALUES = 60_000
FEWEST_VALUES = 400
"""Smallest number of values for recognition; with fewer, the layout is taken to be KITTI's."""
NEARLY = 0.97
"""Share of the best layout's information from which a simpler one, or KITTI's, is preferred."""
CLEARLY = 0.8
"""Share of the best layout's information above which another layout makes it ambiguous."""
SMALLEST, LARGEST, USUAL = 1e-9, 1e9, 0.4
"""Range of magnitudes of a scan's numbers other than 0, and the share of such numbers below which they are not
float32."""
FARTHEST_M = 200_000.0
"""Largest coordinate of a scan, even in millimetres; half of a float64 read as float32 is mostly far larger, or 0."""


def read_bin(data: bytes, layout: tuple[str, ...] | None = None) -> Columns:
    """Columns ``[N]`` by name.

    Without a declared layout, the one is chosen under which a number's column gives most information on its size: x, y,
    z and intensity are distributed differently, and under a wrong layout all columns mix. On 109 scans of all kinds of
    scanners, written with 3 to 6 columns, in order and shuffled, the right one was always chosen.

    Args:
        data: content of the file.
        layout: names of the columns; None to recognise them.

    Raises:
        CloudError: the length fits no layout, or the layout is ambiguous.
    """
    if layout is None:
        layout = recognised(data)
    elif len(data) % (FLOAT_BYTES * len(layout)):
        raise CloudError(
            f"its {len(data)} bytes are not a whole number of rows of {len(layout)} columns ({', '.join(layout)}, as "
            "float32), so "
            "it is truncated or has other columns"
        )
    else:
        _check_declared(np.frombuffer(data, "<f4"), layout)
    rows = np.frombuffer(data, "<f4").reshape(-1, len(layout))
    return {name.lower(): rows[:, place] for place, name in enumerate(layout)}


def recognised(data: bytes) -> tuple[str, ...]:
    """Recognise the layout of a file's rows.

    Raises:
        CloudError: as for `read_bin`.
    """
    fitting = [layout for layout in LAYOUTS if len(data) % (FLOAT_BYTES * len(layout)) == 0]
    if not fitting:
        _check_width(data)
        raise CloudError(
            f"it is truncated or not of float32, since {len(data)} bytes are not a whole number of rows of 3 to 6 "
            f"columns; {DECLARE}"
        )
    values = np.frombuffer(data, "<f4")
    if _halves_are_odd(values):
        _check_width(data)
    if len(values) < FEWEST_VALUES:
        return KITTI if KITTI in fitting else _ask()
    levels = _levels(values[:ENOUGH_VALUES])
    telling = {layout: _telling(levels, len(layout)) for layout in fitting}
    best = max(telling.values())
    good = [layout for layout in fitting if telling[layout] >= best - (1 - NEARLY) * abs(best)]
    chosen = KITTI if KITTI in good else min(good, key=len)
    rivals = [layout for layout in fitting if telling[layout] > CLEARLY * best and len(layout) % len(chosen)]
    if (rivals and chosen is not KITTI) or not _plausible(values.reshape(-1, len(chosen))):
        _check_width(data)
        _ask()
    return chosen


def _check_declared(values: NDArray[np.float32], layout: tuple[str, ...]) -> None:
    """Check a declared layout against the numbers, which mix if there are more or fewer columns.

    Raises:
        CloudError: another number of columns fits much better.
    """
    if len(values) < FEWEST_VALUES:
        return
    levels = _levels(values[:ENOUGH_VALUES])
    others = {len(other) for other in LAYOUTS if len(values) % len(other) == 0} - {len(layout)}
    telling = {columns: _telling(levels, columns) for columns in others}
    best = max(telling, key=lambda columns: telling[columns], default=0)
    if best and _telling(levels, len(layout)) < CLEARLY * telling[best]:
        raise CloudError(
            f"cloud_columns names {len(layout)} columns ({', '.join(layout)}), but its numbers look like rows of {best}"
        )


def _check_width(data: bytes) -> None:
    """Detect numbers of 8 bytes by their magnitudes.

    Raises:
        CloudError: the numbers have 8 bytes.
    """
    with np.errstate(invalid="ignore"):
        values = np.abs(np.frombuffer(data[: len(data) // 8 * 8], "<f8"))
        if len(values) >= FEWEST_VALUES and (values < FARTHEST_M).mean() > 0.99 and (values > 0.1).mean() > 0.3:
            raise CloudError("its numbers seem to be float64; write them as float32 (points.astype('float32').tofile)")


def _halves_are_odd(values: NDArray[np.float32]) -> bool:
    """Whether every other number is 0 or implausible, like the lower halves of float64 numbers."""
    pairs = values[: len(values) // 2 * 2].reshape(-1, 2)
    with np.errstate(invalid="ignore"):
        lower = np.abs(pairs[pairs.any(axis=1), 0])
        usual = (lower > SMALLEST) & (lower < LARGEST)
    return len(lower) > 0 and float(usual.mean()) < USUAL


def _levels(values: NDArray[np.float32]) -> NDArray[np.int64]:
    """The class of each value: 0 if it is not finite, else 1 to `LEVELS` by size."""
    finite = np.isfinite(values)
    known = values[finite]
    levels = np.zeros(len(values), np.int64)
    if len(known):
        borders = np.quantile(known, np.linspace(0, 1, LEVELS + 1)[1:-1])
        levels[finite] = np.searchsorted(borders, known, side="right") + 1
    return levels


def _telling(levels: NDArray[np.int64], columns: int) -> float:
    """Mutual information of a number's column and its size, in nats."""
    levels = levels[: len(levels) // columns * columns]
    column = np.arange(len(levels)) % columns
    joint = np.bincount(column * (LEVELS + 1) + levels, minlength=columns * (LEVELS + 1)).reshape(columns, -1)
    share = joint / len(levels)
    apart = share.sum(1, keepdims=True) * share.sum(0, keepdims=True)
    filled = share > 0
    bias = (columns - 1) * (LEVELS - 1) / (2 * len(levels))
    return float((share[filled] * np.log(share[filled] / apart[filled])).sum() - bias)


def _plausible(rows: NDArray[np.float32]) -> bool:
    """Whether the first three columns may be positions in metres."""
    positions = rows[:, :3]
    finite = np.isfinite(positions).all(axis=1)
    if not finite.any():
        return True  # reported elsewhere
    return bool((np.abs(positions[finite]) < FARTHEST_M).mean() > 0.99)


def _ask() -> NoReturn:
    raise CloudError(f"it does not show how many columns of float32 it has; {DECLARE}")
