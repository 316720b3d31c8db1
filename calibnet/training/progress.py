"""What a training run tells whoever watches it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

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
        self.count = 0

    def add(self, losses: Losses) -> None:
        """Take one step's losses in."""
        self.count += 1
        for name, value in losses._asdict().items():
            self.sums[name] = self.sums.get(name, 0.0) + float(value.detach())

    def take(self) -> dict[str, float]:
        """The means since the last call."""
        means = {name: total / max(1, self.count) for name, total in self.sums.items()}
        self.sums, self.count = {}, 0
        return means
