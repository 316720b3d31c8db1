"""Drawing into a texture tile: tileable noise, colours, rectangles, lettering."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

TILE = 256
"""Side of a tile in pixels."""
Image = NDArray[np.float32]
Colour = tuple[float, float, float]


def noise(generator: Generator, cells: int = 4, octaves: int = 5, gain: float = 0.6) -> Image:
    """Tileable fractal noise ``[256, 256]``, zero mean, unit deviation."""
    import cv2

    total = np.zeros((TILE, TILE), dtype=np.float32)
    for octave in range(octaves):
        side = min(cells << octave, TILE)
        grid = np.pad(generator.normal(size=(side, side)).astype(np.float32), 2, mode="wrap")
        scale = TILE // side
        large = cv2.resize(grid, None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC)
        total += gain**octave * large[2 * scale : 2 * scale + TILE, 2 * scale : 2 * scale + TILE]
    total -= total.mean()
    total /= total.std()
    return total


def colour(generator: Generator, low: float = 0.2, high: float = 0.8, saturation: float = 0.2) -> Colour:
    """A random colour of a given brightness range around grey."""
    grey = generator.uniform(low, high)
    warm, green = generator.uniform(-1.0, 1.0), generator.uniform(-1.0, 1.0)
    if saturation < 0.3:  # walls and stone are grey to warm, never purple
        warm, green = 0.5 + 0.5 * warm, 0.25 * green
    rgb = np.clip(grey * (1.0 + saturation * np.array([warm, green, -warm])), 0.02, 0.98)
    return float(rgb[0]), float(rgb[1]), float(rgb[2])


def flat(rgb: Colour, reflectance: float) -> Image:
    """A tile of one colour."""
    return np.broadcast_to(np.array([*rgb, reflectance], dtype=np.float32), (TILE, TILE, 4)).copy()


def speckled(generator: Generator, rgb: Colour, reflectance: float, amount: float, cells: int = 4) -> Image:
    """A tile of a colour modulated by noise, like asphalt, plaster or soil."""
    image = flat(rgb, reflectance)
    image *= (1.0 + amount * noise(generator, cells))[..., None]
    return image


def rectangle(image: Image, x0: float, y0: float, x1: float, y1: float, rgb: Colour, reflectance: float) -> None:
    """Fill a rectangle given in fractions of the tile."""
    a, b, c, d = (round(value * TILE) for value in (x0, y0, x1, y1))
    image[max(b, 0) : d, max(a, 0) : c] = (*rgb, reflectance)


def scribble(image: Image, generator: Generator, x0: float, y0: float, x1: float, y1: float) -> None:
    """Scribble that looks like lettering from the road."""
    ink = colour(generator, 0.05, 0.95, 0.3)
    x = x0
    while x < x1 - 0.02:
        width = generator.uniform(0.015, 0.05)
        for _ in range(2):
            top = generator.uniform(y0, 0.7 * y0 + 0.3 * y1)
            rectangle(image, x, top, x + 0.4 * width, y1, ink, 0.4)
            x += 0.5 * width
        x += generator.choice([0.008, 0.05], p=[0.8, 0.2])
