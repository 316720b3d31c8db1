"""All five stages from an empty folder: which is trained when, from what, and with how much of the budget."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from calibnet.geometry import MiscalibrationRange
from calibnet.training.options import TrainingOptions
from calibnet.training.recipe import RECIPE, Recipe
from calibnet.weights import weights_path

FEATURES = "features"
"""Folder, within the output's, of the first step's weights: a start for the others, none of the five stages."""


def all_stages(options: TrainingOptions, recipe: Recipe = RECIPE) -> list[TrainingOptions]:
    """What to train, in order; steps that have their weights in the output folder already are left out.

    Each step but the first keeps the first one's image branch, so that it is computed once a frame and size, and
    most of its miscalibrations are what the stages before it leave behind.

    Args:
        options: of the whole: its budget is shared out, its range is not looked at.
        recipe: its schedule says which stage is trained when, from which, and with how much of the budget.
    """
    schedule = recipe.schedule
    whole = Path(options.output)
    folders = [whole if step.neighbour else whole / FEATURES for step in schedule]
    paths = [weights_path(options.preset, step.range, folder) for step, folder in zip(schedule, folders, strict=True)]

    def latest(range_: MiscalibrationRange, position: int) -> Path:
        """Weights of a stage as they are before the step at this position."""
        return next(paths[earlier] for earlier in reversed(range(position)) if schedule[earlier].range == range_)

    return [
        replace(
            options,
            range=str(step.range),
            output=str(folders[position]),
            minutes=options.minutes and options.minutes * step.share,
            samples=options.samples and max(options.batch, round(options.samples * step.share)),
            learning_rate=options.learning_rate * step.learning_rate,
            initialize=str(latest(step.neighbour, position)) if step.neighbour else options.initialize,
            after=str(whole) if step.neighbour else None,
        )
        for position, step in enumerate(schedule)
        if not paths[position].is_file()
    ]
