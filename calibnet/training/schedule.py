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
        bounds: the stage.
        share: of the whole budget.
        neighbour: stage whose weights it starts from; None for the first, which learns the features.
        learning_rate: relative to the first one's.
    """

    bounds: MiscalibrationRange
    share: float
    neighbour: MiscalibrationRange | None
    learning_rate: float


WIDEST, WIDE, MIDDLE, NARROW, NARROWEST = RANGES
SCHEDULE = (
    # the middle range first: most of the truth lies within the finest window there, so every scale learns to match
    Step(MIDDLE, 0.60, None, 1.0),
    Step(WIDEST, 0.12, MIDDLE, 0.6),
    Step(WIDE, 0.08, MIDDLE, 0.6),
    Step(NARROW, 0.12, MIDDLE, 0.6),
    Step(NARROWEST, 0.08, NARROW, 0.4),
)
"""Each stage but the first keeps the first one's image branch, so that it is computed once a frame, and
most of its miscalibrations are what the stages before it leave behind."""


def all_stages(options: TrainingOptions) -> list[TrainingOptions]:
    """What to train, in order; stages that have their weights in the output folder already are left out.

    Args:
        options: of the whole: its budget is shared out, its range is not looked at.
    """
    folder = Path(options.output)

    def path(bounds: MiscalibrationRange) -> Path:
        return weights_path(options.preset, bounds, folder)

    return [
        replace(
            options,
            range=str(step.bounds),
            minutes=options.minutes and options.minutes * step.share,
            samples=options.samples and max(options.batch, round(options.samples * step.share)),
            learning_rate=options.learning_rate * step.learning_rate,
            initialize=str(path(step.neighbour)) if step.neighbour else options.initialize,
            after=str(folder) if step.neighbour else None,
        )
        for step in SCHEDULE
        if not path(step.bounds).is_file()
    ]
