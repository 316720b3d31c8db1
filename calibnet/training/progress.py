"""The progress that a training run reports."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import torch
from torch import Tensor

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
        self.steps: list[Tensor] = []
        self.names: tuple[str, ...] = ()

    def add(self, losses: Losses | MethodLosses) -> None:
        """Add the losses of one step; they stay on the device, as reading them would make the host wait."""
        self.names = losses._fields
        self.steps.append(torch.stack([value.detach().float() for value in losses]))

    def take(self) -> dict[str, float]:
        """The means since the last call, over the steps that have a value; NaN if none has.

        A step on features alone has no pose errors.
        """
        if not self.steps:
            return dict.fromkeys(self.names, math.nan)
        means = torch.stack(self.steps).double().nanmean(0)
        self.steps = []
        return dict(zip(self.names, means.tolist(), strict=True))


class Every:
    """Says when a task is due that is repeated after every ``seconds`` of training."""

    def __init__(self, seconds: float, now: float) -> None:
        self.seconds, self.last = seconds, now

    def due(self, now: float) -> float:
        """If the task is due, the seconds since it was last; otherwise 0."""
        elapsed = now - self.last
        if elapsed <= self.seconds:
            return 0.0
        self.last = now
        return elapsed
