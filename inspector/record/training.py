"""A training run as a Rerun recording: losses and validation figures over samples."""

from __future__ import annotations

import itertools
import math
from pathlib import Path
from typing import TYPE_CHECKING
from uuid import uuid4

import rerun as rr
import rerun.blueprint as rrb

from calibnet.runtime.claim import Claim
from calibnet.runtime.writing import Kind
from inspector import colors, entities
from inspector.record.pictures.legends import log_names
from inspector.record.stream import Stream
from inspector.record.subtree import Subtree
from inspector.record.tabs.views import View, curve_view, legend

if TYPE_CHECKING:
    from calibnet.training.progress import Progress
    from calibnet.training.validation import ValidationFigures


LEGEND_ERRORS, LEGEND_LOSSES = "legend/errors", "legend/losses"
ON_TRAINING = ("training", colors.STAGES[4])
HELD_OUT = {
    "{}": ("held-out frames, median", colors.FOUND),
    "{}_p95": ("95 % of them are below", colors.STAGES[2]),
    "initial_{}": ("before the stage, median", colors.INITIAL),
}
"""Curves of figures on held-out frames, by the pattern of their names: what they are called, and their colour."""
MARK, HELD_OUT_MARK = 2.5, 6.0
"""Sizes of the marks on curves; those of held-out frames are few, and a short run has a single one at its end."""


class TrainingLog:
    """Observes a `Trainer`; every line of progress becomes a row, flushed at once."""

    def __init__(self, path: Path, name: str) -> None:
        self._claim = Claim(path, Kind.RECORDING)
        sinks = [self._claim.begin()]
        self._stream = Stream(entities.TRAINING_APPLICATION_ID, uuid4().hex, name, sinks, training_blueprint())
        self.recording = self._stream.rec
        self._rec = Subtree(self.recording)
        log_names(self._rec, LEGEND_ERRORS, dict([ON_TRAINING, *HELD_OUT.values()]))
        for kind, unit in entities.ERROR_KINDS.items():
            self._name(f"{entities.TRAINING}/{kind}_{unit}", *ON_TRAINING)
            for pattern, named in HELD_OUT.items():
                self._name(f"{entities.VALIDATION}/{pattern.format(kind)}_{unit}", *named, HELD_OUT_MARK)

    def progressed(self, progress: Progress) -> None:
        """Log the running means of the losses."""
        names = [name for name in progress.losses if not name.endswith(tuple(entities.ERROR_KINDS.values()))]
        terms = dict(zip(names, itertools.cycle(colors.STAGES.values())))
        log_names(self._rec, LEGEND_LOSSES, terms)
        for name, color in terms.items():
            self._name(f"{entities.TRAINING}/{name}", name, color)
        self._at(progress)
        for loss, value in progress.losses.items():
            if not math.isfinite(value):  # the warm-up has no pose, and so no error
                continue
            self.recording.log(f"{entities.TRAINING}/{loss}", rr.Scalars(value))
        self._stream.flush()

    def validated(self, progress: Progress, figures: ValidationFigures) -> None:
        """Log the errors on the held-out frames."""
        self._at(progress)
        for figure, value in figures._asdict().items():
            self.recording.log(f"{entities.VALIDATION}/{figure}", rr.Scalars(value))
        self._stream.flush()

    def __enter__(self) -> TrainingLog:
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        """Write the footer; an earlier recording of the same name is removed, or kept if the run did not finish."""
        self._stream.close()
        if kind is None:
            self._claim.complete()
        self._claim.release()

    def _name(self, path: str, name: str, color: colors.Rgb, mark: float = MARK) -> None:
        line = rr.SeriesLines(names=name, colors=color, widths=2.0)
        self._rec.log_once(path, line, rr.SeriesPoints(names=name, colors=color, marker_sizes=mark))

    def _at(self, progress: Progress) -> None:
        self.recording.set_time("samples", sequence=progress.samples)
        self.recording.set_time("training time", duration=60 * progress.minutes)


def training_blueprint() -> rrb.Blueprint:
    """Errors in degrees and centimetres above, what was minimised below."""
    errors = rrb.Horizontal(
        *(
            curve_view(
                f"{kind.capitalize()} error [{unit}]",
                "/",
                f"/{entities.TRAINING}/{kind}_{unit}",
                *(f"/{entities.VALIDATION}/{name.format(kind)}_{unit}" for name in HELD_OUT),
            )
            for kind, unit in entities.ERROR_KINDS.items()
        )
    )
    figures = (f"- /{entities.TRAINING}/{kind}_{unit}" for kind, unit in entities.ERROR_KINDS.items())
    losses = curve_view("Terms of the loss, weighted", f"/{entities.TRAINING}", "$origin/**", *figures)
    rows: list[View] = [errors, legend("Errors", LEGEND_ERRORS), losses, legend("Losses", LEGEND_LOSSES)]
    panel = rrb.TimePanel(timeline="samples", state="collapsed")
    return rrb.Blueprint(rrb.Vertical(*rows, row_shares=[10, 1, 10, 1]), panel, collapse_panels=True)
