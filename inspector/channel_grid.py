"""Feature maps as one picture: the liveliest channels side by side."""

from __future__ import annotations

import io
from typing import Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from inspector.colors import VIRIDIS

CHANNELS: Final = 16
"""Channels shown at most: those that vary most."""
COLUMNS: Final = 4


def channel_grid(activations: NDArray[np.floating]) -> NDArray[np.uint8]:
    """Lay out ``[C, h, w]`` activations, `COLUMNS` maps a row, each stretched to its own contrast.

    Returns:
        ``[H, W]`` uint8 levels, 0 in the gaps of one pixel between the maps.
    """
    maps = np.nan_to_num(activations.astype(np.float32))
    liveliest = np.argsort(-maps.std(axis=(1, 2)), kind="stable")[:CHANNELS]
    maps = maps[liveliest]
    low = maps.min(axis=(1, 2), keepdims=True)
    span = np.maximum(maps.max(axis=(1, 2), keepdims=True) - low, 1e-6)
    tiles = (255.0 * (maps - low) / span).astype(np.uint8)
    count, height, width = tiles.shape
    rows = -(-count // COLUMNS)
    grid = np.zeros((rows * (height + 1) - 1, COLUMNS * (width + 1) - 1), dtype=np.uint8)
    for position, tile in enumerate(tiles):
        top, left = (position // COLUMNS) * (height + 1), (position % COLUMNS) * (width + 1)
        grid[top : top + height, left : left + width] = tile
    return grid


def channel_grid_png(activations: NDArray[np.floating]) -> bytes:
    """The grid in viridis, as a PNG with a palette: lossless, and one byte a cell before deflation."""
    picture = Image.fromarray(channel_grid(activations))
    picture.putpalette(VIRIDIS.tobytes())
    encoded = io.BytesIO()
    picture.save(encoded, format="png")
    return encoded.getvalue()
