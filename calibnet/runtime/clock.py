"""Measures the wall time of the parts of a stage."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager

import torch
from torch import nn


@contextmanager
def after_each(parts: Mapping[str, nn.Module], done: Callable[[str], None]) -> Iterator[None]:
    """A context in which ``done`` is called with a module's name after each call of the module."""
    handles = [module.register_forward_hook(lambda *_, part=part: done(part)) for part, module in parts.items()]
    try:
        yield
    finally:
        for handle in handles:
            handle.remove()


class Clock:
    """Wall time by part, in milliseconds."""

    def __init__(self, device: torch.device) -> None:
        self.device = device
        self.parts: dict[str, float] = {}
        self.last = time.perf_counter()

    def skip(self) -> None:
        """Ignore the time since the last call, which was measured elsewhere."""
        self.last = time.perf_counter()

    def __call__(self, part: str) -> None:
        """Add the time since the last call to ``part``."""
        if self.device.type == "cuda":
            torch.cuda.synchronize(self.device)  # GPU work is only queued
        now = time.perf_counter()
        self.parts[part] = self.parts.get(part, 0.0) + 1000 * (now - self.last)
        self.last = now
