"""Text as pictures: captions and legends that look the same in a light and in a dark viewer.

The viewer writes labels in the colour of their points on the background of its theme, where white letters vanish in the
light one. A picture has its own background.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from inspector import colors

LEVELS: Final = 16
"""Number of shades between background and letters, which takes half a byte per pixel."""
DOT: Final = 0.34
"""Radius of the dot before a name, relative to the height of the letters."""


@lru_cache(maxsize=16)
def font(height: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    """Pillow's built-in font, with letters of the given height in pixels."""
    return ImageFont.load_default(float(height))


def letter_width(text: str, height: int) -> int:
    """Width of a line of text in pixels."""
    return int(np.ceil(font(height).getlength(text)))


def text_png(lines: Sequence[str], size: tuple[int, int], height: int, color: colors.Rgb) -> bytes:
    """Lines of centred text as PNG, in letters of ``height`` pixels, or smaller ones if a line would not fit.

    Args:
        lines: from top to bottom.
        size: width and height of the picture in pixels.
        height: height of the letters.
        color: colour of the letters; the background is `colors.GROUND`.
    """
    mask = Image.new("L", size)
    drawing, row = ImageDraw.Draw(mask), size[1] / len(lines)
    for position, line in enumerate(lines):
        fitting = min(height, int(height * 0.96 * size[0] / max(1, letter_width(line, height))))
        drawing.text((size[0] / 2, row * (position + 0.5)), line, 255, font(fitting), anchor="mm")
    share = np.linspace(0.0, 1.0, LEVELS)[:, None]
    palette = (1 - share) * np.array(colors.GROUND) + share * np.array(color)
    picture = Image.fromarray((np.asarray(mask) // (256 // LEVELS)).astype(np.uint8))
    picture.putpalette(palette.round().astype(np.uint8).tobytes())
    return _png(picture, bits=4)


def names_png(names: Sequence[tuple[str, colors.Rgb]], height: int) -> bytes:
    """Names in a row, each after a dot in its colour."""
    letters = round(0.55 * height)
    gap = 2 * letters
    widths = [gap + letter_width(name, letters) + gap // 2 for name, _ in names]
    picture = Image.new("RGB", (sum(widths) + gap // 2, height), colors.GROUND)
    drawing, left = ImageDraw.Draw(picture), gap // 2
    for (name, color), width in zip(names, widths, strict=True):
        radius, middle = DOT * letters, (left + letters / 2, height / 2)
        drawing.ellipse([middle[0] - radius, middle[1] - radius, middle[0] + radius, middle[1] + radius], color)
        drawing.text((left + 1.3 * letters, height / 2), name, colors.LETTERS, font(letters), anchor="lm")
        left += width
    return _png(picture.quantize(64))


def bar_png(strip: NDArray[np.uint8], labels: dict[float, str], height: int) -> bytes:
    """A strip of colours ``[W, 3]`` with labels by their position, 0..1, in black or white for contrast."""
    picture = Image.fromarray(np.tile(strip, (height, 1, 1)))
    drawing, letters, width = ImageDraw.Draw(picture), round(0.5 * height), len(strip)
    for place, label in labels.items():
        half = letter_width(label, letters) / 2
        middle = float(np.clip(place * (width - 1), half + 0.3 * letters, width - 1 - half - 0.3 * letters))
        under = strip[round(middle - half) : round(middle + half) + 1].mean(axis=0)
        color = (0, 0, 0) if under @ [0.299, 0.587, 0.114] > 120 else (255, 255, 255)
        at = place * (width - 1)
        drawing.line([at, 0, at, 0.18 * height], color, width=3)
        drawing.text((middle, 0.56 * height), label, color, font(letters), anchor="mm")
    return _png(picture)


def _png(picture: Image.Image, bits: int | None = None) -> bytes:
    encoded = io.BytesIO()
    picture.save(encoded, format="png", compress_level=6, **({} if bits is None else {"bits": bits}))
    return encoded.getvalue()
