"""Plans the training of all five stages from an empty folder: their order, initial weights and shares of the budget."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from calibnet.geometry import MiscalibrationRange
from calibnet.training.options import TrainingOptions
from calibnet.training.recipe import RECIPE, Recipe
from calibnet.weights import weights_path

FEATURES = "features"
"""Subfolder of the output folder for the weights of the first step, which only the other steps start from."""


def all_stages(options: TrainingOptions, recipe: Recipe = RECIPE) -> list[TrainingOptions]:
    """The runs to train, in order; steps whose weights are in the output folder already are left out.

    All steps after the first keep its image branch, which is then computed once per frame and size, and draw most of
    their miscalibrations from the residuals of the stages before.

    Args:
        options: options of the whole, whose budget is divided among the steps; their range is not used.
        recipe: its schedule has the order, the initial weights and the shares of the budget.
    """
    schedule = recipe.schedule
    whole = Path(options.output)
    folders = [whole if step.neighbour else whole / FEATURES for step in schedule]
    paths = [weights_path(options.preset, step.range, folder) for step, folder in zip(schedule, folders, strict=True)]

    def latest(range_: MiscalibrationRange, position: int) -> Path:
        """The newest weights of a stage before the step at this position."""
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
