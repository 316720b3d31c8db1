"""Memory that is free, handed back to the system."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache


def hand_back() -> None:
    """Hand back what the C library keeps of memory that was freed; does nothing where that is not glibc.

    Arrays of a frame are freed among small things that stay, and glibc keeps the gaps between these: some 0.1 MB more
    with every frame of a run. It takes some milliseconds, and pages that are used again have to be cleared again.
    """
    trim = _trim()
    if trim is not None:
        trim(0)


@cache
def _trim() -> Callable[[int], int] | None:
    try:
        trim: Callable[[int], int] = ctypes.CDLL(None).malloc_trim
    except (AttributeError, OSError, TypeError):  # Windows has no library without a name
        return None
    return trim
