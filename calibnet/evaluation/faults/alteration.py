"""What all faults have in common."""

from __future__ import annotations

from collections.abc import Callable

from calibnet.datasets.frame import Frame

NATIVE_WIDTH = 1242
"""Width of the picture whose pixels strengths are given in; in another one, as many of its own in proportion."""

Alteration = Callable[[Frame], Frame]
"""Puts a fault into a frame."""


def unaltered(frame: Frame) -> Frame:
    """The frame as it is."""
    return frame
