"""An aggregated cost volume as one picture: a tile for every displacement, with the important ones framed."""

from __future__ import annotations

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from calibnet.trace import ScaleTrace
from inspector import colors
from inspector.record.pictures.channel_grid import palette_png, slice_grid

INSET = 0.15
"""Inset of a frame within another one of the same tile, relative to the tile's height."""
BRIGHTEST_PERCENTILE = 90.0
"""Percentile of the cells' peak probabilities that is drawn brightest."""


def slices_picture(scale: ScaleTrace) -> rr.EncodedImage:
    """All slices of the volume, ``dx`` to the right and ``dy`` down."""
    peak = scale.probability.max(axis=(0, 1))[scale.occupied]
    high = float(np.percentile(peak, BRIGHTEST_PERCENTILE)) if len(peak) else 1.0
    grid = slice_grid(scale.probability, scale.occupied, high)
    return rr.EncodedImage(contents=palette_png(grid), media_type="image/png")


def slice_marks(scale: ScaleTrace, true: NDArray[np.float32] | None) -> rr.Boxes2D:
    """Frames around the tile without displacement, the one that won most cells and the true one.

    Args:
        scale: the volume.
        true: ``[h, w, 2]`` pixels, the true displacement of each cell, whose median is marked; None if unknown.
    """
    down, across, height, width = scale.probability.shape
    middle = np.array([across // 2, down // 2])
    marked = [(np.zeros(2, dtype=int), colors.INITIAL)]
    marked.append((_most_common(scale.best[scale.occupied]), colors.FOUND))
    if true is not None and scale.occupied.any():
        typical = np.rint(np.median(true[scale.occupied], axis=0) / scale.stride).astype(int)
        marked.append((np.clip(typical, -middle, middle), colors.REFERENCE))
    tile, cells = np.array([width + 1, height + 1]), [tuple(cell) for cell, _ in marked]
    inset = [INSET * tile.min() * cells[:position].count(cell) for position, cell in enumerate(cells)]
    return rr.Boxes2D(  # frames of one tile are nested
        mins=[(middle + cell) * tile + by for cell, by in zip(cells, inset, strict=True)],
        sizes=[tile - 2 * by for by in inset],
        colors=[color for _, color in marked],
        radii=rr.Radius.ui_points(2.0),
    )


def _most_common(cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """The most frequent displacement ``(dx, dy)`` of ``[N, 2]``; none if there are no cells."""
    if not len(cells):
        return np.zeros(2, dtype=np.int64)
    found, counts = np.unique(cells, axis=0, return_counts=True)
    return np.asarray(found[counts.argmax()])
