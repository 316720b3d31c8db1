"""How large the caption above an overlay is; layouts leave room for it."""

from __future__ import annotations

from typing import NamedTuple

LETTERS_OF_WIDTH, LETTERS_OF_HEIGHT = 0.04, 0.1
"""Height of the letters, in widths of a wide picture and in heights of a high one, as views scale them."""
ONE_LINE = 2.2
"""Width over height of a picture from which on a name and its figures fit into one line."""


class Strip(NamedTuple):
    """The caption's letters and its own height, in pixels of the picture below it."""

    letters: int
    lines: int
    height: int


def caption_strip(image: tuple[int, int]) -> Strip:
    """The caption's size above a picture of this width and height."""
    width, height = image
    letters = max(8, round(max(LETTERS_OF_WIDTH * width, LETTERS_OF_HEIGHT * height)))
    lines = 1 if width >= ONE_LINE * height else 2
    return Strip(letters, lines, round(1.3 * letters * lines))
