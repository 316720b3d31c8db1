"""What a training run tells whoever watches it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

from calibnet.methods.learned.network import MethodLosses
from calibnet.training.losses import Losses
from calibnet.training.validation import ValidationFigures


@dataclass(frozen=True)
class Progress:
    """One line of progress."""

    samples: int
    minutes: float
    share: float  # of the budget, 0..1
    samples_per_second: float
    losses: dict[str, float]


class Observer(Protocol):
    """Watches a run; the command line prints, the inspector logs to Rerun."""

    def progressed(self, progress: Progress) -> None:
        """Called every few seconds with running means of the losses."""

    def validated(self, progress: Progress, figures: ValidationFigures) -> None:
        """Called after each validation."""


class Means:
    """Running means of the losses between two progress lines."""

    def __init__(self) -> None:
        self.sums: dict[str, float] = {}
        self.counts: dict[str, int] = {}

    def add(self, losses: Losses | MethodLosses) -> None:
        """Take one step's losses in; what it does not tell, as features alone have no pose, is left out."""
        for name, value in losses._asdict().items():
            number = float(value.detach())
            known = not math.isnan(number)
            self.sums[name] = self.sums.get(name, 0.0) + (number if known else 0.0)
            self.counts[name] = self.counts.get(name, 0) + known

    def take(self) -> dict[str, float]:
        """The means since the last call; NaN where no step told."""
        means = {name: total / (self.counts[name] or math.nan) for name, total in self.sums.items()}
        self.sums, self.counts = {}, {}
        return means


class Every:
    """Something that is due each time so many seconds of training have passed."""

    def __init__(self, seconds: float, now: float) -> None:
        self.seconds, self.last = seconds, now

    def due(self, now: float) -> float:
        """Seconds since it was due last, if these are more than it has to wait; otherwise 0."""
        elapsed = now - self.last
        if elapsed <= self.seconds:
            return 0.0
        self.last = now
        return elapsed
