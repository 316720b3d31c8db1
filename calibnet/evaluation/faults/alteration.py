"""The type of all faults, and the unit of their strengths."""

from __future__ import annotations

from collections.abc import Callable

from calibnet.datasets.frame import Frame

NATIVE_WIDTH = 1242
"""Image width to which strengths in pixels refer ("native pixels"); they scale with the width of an image."""

Alteration = Callable[[Frame], Frame]
"""Puts a fault into a frame."""


def unaltered(frame: Frame) -> Frame:
    """The frame as it is."""
    return frame
