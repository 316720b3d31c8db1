"""Memory that was freed goes back to the system."""

from __future__ import annotations

import ctypes
import platform

import psutil
import pytest

from calibnet.runtime import memory

MEGABYTE = 1 << 20


def resident() -> float:
    return psutil.Process().memory_info().rss / MEGABYTE


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="others keep nothing that could be handed back")
def test_gaps_between_what_stays_are_handed_back() -> None:
    """64 MB in pieces too small to be mapped alone, every other one freed: nothing at the heap's end can go."""
    library = ctypes.CDLL(None)
    library.malloc.restype, library.malloc.argtypes = ctypes.c_void_p, [ctypes.c_size_t]
    library.free.argtypes = [ctypes.c_void_p]
    size = 64 << 10
    pieces = [library.malloc(size) for _ in range(1024)]
    for piece in pieces:
        ctypes.memset(piece, 1, size)
    for piece in pieces[::2]:
        library.free(piece)
    before = resident()
    memory.hand_back()
    after = resident()
    for piece in pieces[1::2]:
        library.free(piece)
    assert before - after > 20  # of 32 that were freed


@pytest.mark.parametrize("error", [AttributeError, OSError, TypeError])
def test_another_library_is_left_alone(error: type[Exception], monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(_: None) -> None:
        raise error

    memory._trim.cache_clear()
    monkeypatch.setattr(ctypes, "CDLL", missing)
    memory.hand_back()
    memory._trim.cache_clear()
