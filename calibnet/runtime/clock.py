"""Wall time of the parts of a stage."""

from __future__ import annotations

import time

import torch


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
