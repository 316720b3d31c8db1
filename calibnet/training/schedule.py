"""All five stages from an empty folder: which is trained when, from what, and with how much of the budget."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from calibnet.geometry import RANGES, MiscalibrationRange
from calibnet.training.options import TrainingOptions
from calibnet.weights import weights_path


@dataclass(frozen=True)
class Step:
    """One stage's turn.

    Attributes:
        range: the stage.
        share: of the whole budget.
        neighbour: stage whose weights it starts from; None for the first, which learns the features.
        learning_rate: relative to the first one's.
    """

    range: MiscalibrationRange
    share: float
    neighbour: MiscalibrationRange | None
    learning_rate: float


WIDEST, WIDE, MIDDLE, NARROW, NARROWEST = RANGES
SCHEDULE = (
    # the middle range first: most of the truth lies within the finest window there, so every scale learns to match
    Step(MIDDLE, 0.55, None, 1.0),
    Step(WIDEST, 0.12, MIDDLE, 0.6),
    Step(WIDE, 0.08, MIDDLE, 0.6),
    # and again, now that there are stages before it whose errors it can be shown
    Step(MIDDLE, 0.06, MIDDLE, 0.5),
    Step(NARROW, 0.11, MIDDLE, 0.6),
    Step(NARROWEST, 0.08, NARROW, 0.4),
)
"""Each step but the first keeps the first one's image branch, so that it is computed once a frame and size, and
most of its miscalibrations are what the stages before it leave behind."""

FEATURES = "features"
"""Folder, within the output's, of the first step's weights: a start for the others, none of the five stages."""


def all_stages(options: TrainingOptions) -> list[TrainingOptions]:
    """What to train, in order; steps that have their weights in the output folder already are left out.

    Args:
        options: of the whole: its budget is shared out, its range is not looked at.
    """
    whole = Path(options.output)
    folders = [whole if step.neighbour else whole / FEATURES for step in SCHEDULE]
    paths = [weights_path(options.preset, step.range, folder) for step, folder in zip(SCHEDULE, folders, strict=True)]

    def latest(range_: MiscalibrationRange, position: int) -> Path:
        """Weights of a stage as they are before the step at this position."""
        return next(paths[earlier] for earlier in reversed(range(position)) if SCHEDULE[earlier].range == range_)

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
        for position, step in enumerate(SCHEDULE)
        if not paths[position].is_file()
    ]
