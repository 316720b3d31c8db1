"""Many small maps as one picture with a palette, such as activations by channel or volume slices by displacement."""

from __future__ import annotations

import io
from typing import Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from inspector.colors import EMPTY, VIRIDIS
from inspector.record.pictures.lettering import font

CHANNELS: Final = 8
"""Largest number of channels shown; those that vary most are chosen."""
COLUMNS: Final = 4
TILE_WIDTH: Final = 176
"""Width of a tile in pixels, to which maps are magnified so that the letters above them are sharp."""
HEADER: Final = 16
"""Height of the text above a tile and above all tiles, in pixels."""
GAP, TEXT = 0, 255
"""Palette entries that are not levels."""
LOWEST, HIGHEST = 1, 254
PALETTE: Final = np.concatenate([[EMPTY], VIRIDIS[LOWEST : HIGHEST + 1], [(255, 255, 255)]]).astype(np.uint8)


def liveliest_channels(activations: NDArray[np.floating]) -> NDArray[np.intp]:
    """Ascending numbers of the `CHANNELS` channels of ``[C, h, w]`` that vary most, without constant ones."""
    spread = np.nan_to_num(activations.astype(np.float32)).std(axis=(1, 2))
    liveliest = np.argsort(-spread, kind="stable")[:CHANNELS]
    varying = liveliest[spread[liveliest] > 0]
    return np.sort(varying if varying.size else liveliest[:1])


def channel_grid(
    activations: NDArray[np.floating], low: float, high: float, numbers: NDArray[np.integer]
) -> NDArray[np.uint8]:
    """Lay out ``[C, h, w]`` activations in rows of `COLUMNS` tiles, with numbers above the tiles and the scale on top.

    Args:
        activations: maps of any size.
        low: value of the darkest colour.
        high: value of the brightest.
        numbers: ``[C]`` numbers of the channels.

    Returns:
        ``[H, W]`` uint8 entries of `PALETTE`.
    """
    scale = max(1, TILE_WIDTH // activations.shape[2])
    tiles = levels(activations, low, high).repeat(scale, axis=1).repeat(scale, axis=2)
    _, height, width = tiles.shape
    rows = -(-len(tiles) // COLUMNS)
    grid = np.full((HEADER + rows * (height + HEADER), COLUMNS * (width + 2) - 2), GAP, dtype=np.uint8)
    grid[:HEADER][_words(f"dark {low:.2f}, bright {high:.2f}", grid.shape[1])] = TEXT
    for position, (channel, tile) in enumerate(zip(numbers.tolist(), tiles, strict=True)):
        top, left = HEADER + (position // COLUMNS) * (height + HEADER), (position % COLUMNS) * (width + 2)
        grid[top : top + HEADER, left : left + width][_words(f"channel {channel}", width)] = TEXT
        grid[top + HEADER : top + HEADER + height, left : left + width] = tile
    return grid


def slice_grid(volume: NDArray[np.floating], occupied: NDArray[np.bool_], high: float) -> NDArray[np.uint8]:
    """All slices of a volume ``[Dy, Dx, h, w]`` side by side, ``dx`` to the right and ``dy`` down.

    Returns:
        ``[Dy (h + 1), Dx (w + 1)]`` uint8 entries of `PALETTE`; cells without a LiDAR point are empty.
    """
    tiles = np.where(occupied, levels(volume, 0.0, high), GAP).astype(np.uint8)
    padded = np.pad(tiles, ((0, 0), (0, 0), (0, 1), (0, 1)), constant_values=GAP)
    across, down = volume.shape[1] * padded.shape[3], volume.shape[0] * padded.shape[2]
    grid: NDArray[np.uint8] = padded.transpose(0, 2, 1, 3).reshape(down, across)
    return grid


def _words(text: str, width: int) -> NDArray[np.bool_]:
    """The pixels ``[HEADER, width]`` of a text, without half-tones, for which the palette has no entries."""
    drawn = Image.new("1", (width, HEADER))
    ImageDraw.Draw(drawn).text((2, HEADER / 2), text, 1, font(HEADER - 4), anchor="lm")
    return np.asarray(drawn)


def levels(values: NDArray[np.floating], low: float, high: float) -> NDArray[np.uint8]:
    """Palette entries `LOWEST` to `HIGHEST` of values from ``low`` to ``high``, same shape."""
    share = np.clip((np.nan_to_num(values.astype(np.float32)) - low) / max(high - low, 1e-6), 0.0, 1.0)
    entries: NDArray[np.uint8] = (LOWEST + (HIGHEST - LOWEST) * share).astype(np.uint8)
    return entries


def palette_png(grid: NDArray[np.uint8]) -> bytes:
    """The picture as a PNG with a palette."""
    picture = Image.fromarray(grid)
    picture.putpalette(PALETTE.tobytes())
    encoded = io.BytesIO()
    picture.save(encoded, format="png", compress_level=3)
    return encoded.getvalue()
