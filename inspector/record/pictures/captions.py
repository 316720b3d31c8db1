"""The size of the caption above an overlay, for which layouts leave room."""

from __future__ import annotations

from typing import NamedTuple

LETTERS_OF_WIDTH, LETTERS_OF_HEIGHT = 0.04, 0.1
"""Height of the letters, relative to the width of a wide image and to the height of a tall one."""
ONE_LINE = 2.2
"""Aspect ratio of an image from which a name and its figures fit on one line."""


class Strip(NamedTuple):
    """Heights of the caption's letters and of the caption itself, in pixels of the image below it."""

    letters: int
    lines: int
    height: int


def caption_strip(image: tuple[int, int], figures: bool = True) -> Strip:
    """The size of the caption above an image of this width and height, with figures or without."""
    width, height = image
    letters = max(8, round(max(LETTERS_OF_WIDTH * width, LETTERS_OF_HEIGHT * height)))
    lines = 2 if figures and width < ONE_LINE * height else 1
    return Strip(letters, lines, round(1.3 * letters * lines))
