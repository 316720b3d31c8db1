"""Returns free memory to the system."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache


def hand_back() -> None:
    """Return memory that the C library keeps after it was freed; does nothing without glibc.

    Arrays of a frame are freed between small objects that stay, and glibc keeps the gaps: about 0.1 MB per frame of a
    run. A call takes some milliseconds, and pages that are reused have to be cleared again.
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
