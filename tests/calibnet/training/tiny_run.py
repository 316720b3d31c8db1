"""Training runs of a tiny network that take a second: their options, their trainer, and who watches them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from calibnet.training.build import build
from calibnet.training.options import TrainingOptions
from calibnet.training.progress import Progress
from calibnet.training.recipe import RECIPE, Recipe
from calibnet.training.trainer import Trainer
from calibnet.training.validation import ValidationFigures

BATCH = 4


class Watcher:
    """Keeps what it is told."""

    def __init__(self) -> None:
        self.progress: list[Progress] = []
        self.figures: list[ValidationFigures] = []

    def progressed(self, progress: Progress) -> None:
        self.progress.append(progress)

    def validated(self, progress: Progress, figures: ValidationFigures) -> None:
        self.figures.append(figures)


def options(folder: Path, batches: int = 4, **changes: Any) -> TrainingOptions:
    values: dict[str, Any] = {"preset": "tiny", "range": "5/0.5", "output": str(folder), "workers": 0, "batch": BATCH}
    values |= {"warm_up": 2 * BATCH, "samples": batches * BATCH}
    return TrainingOptions(**values | changes)


def trainer_of(
    options: TrainingOptions, recipe: Recipe = RECIPE, watcher: Watcher | None = None, resume: bool = False
) -> Trainer:
    return Trainer(build(options, recipe), watcher or Watcher(), resume)
