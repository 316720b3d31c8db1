"""Wall time of the parts of a stage."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager

import torch
from torch import nn


@contextmanager
def after_each(parts: Mapping[str, nn.Module], done: Callable[[str], None]) -> Iterator[None]:
    """Call ``done`` with the name of each module after each of its calls, while this lasts."""
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
        """Everything since the last call was timed elsewhere."""
        self.last = time.perf_counter()

    def __call__(self, part: str) -> None:
        """Everything since the last call was ``part``."""
        if self.device.type == "cuda":
            torch.cuda.synchronize(self.device)  # work is only queued there
        now = time.perf_counter()
        self.parts[part] = self.parts.get(part, 0.0) + 1000 * (now - self.last)
        self.last = now
