"""A training run as a Rerun recording: losses and validation figures over samples."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING
from uuid import uuid4

import rerun as rr
import rerun.blueprint as rrb

from calibnet.runtime.claim import Claim
from calibnet.runtime.writing import Kind
from inspector import entities
from inspector.record.stream import Stream

if TYPE_CHECKING:
    from calibnet.training.progress import Progress
    from calibnet.training.validation import ValidationFigures


class TrainingLog:
    """Observes a `Trainer`; every line of progress becomes a row, flushed at once."""

    def __init__(self, path: Path, name: str) -> None:
        self._claim = Claim(path, Kind.RECORDING)
        sinks = [self._claim.begin()]
        self._stream = Stream(entities.TRAINING_APPLICATION_ID, uuid4().hex, name, sinks, training_blueprint())
        self.recording = self._stream.rec

    def progressed(self, progress: Progress) -> None:
        """Log the running means of the losses."""
        self._at(progress)
        for loss, value in progress.losses.items():
            if not math.isfinite(value):  # the warm-up has no pose whose error could be plotted
                continue
            self.recording.log(f"{entities.TRAINING}/{loss}", rr.Scalars(value))
        self._stream.flush()

    def validated(self, progress: Progress, figures: ValidationFigures) -> None:
        """Log the figures of the held-out frames."""
        self._at(progress)
        for figure, value in figures._asdict().items():
            self.recording.log(f"{entities.VALIDATION}/{figure}", rr.Scalars(value))
        self._stream.flush()

    def __enter__(self) -> TrainingLog:
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        """Write the footer; an earlier recording of the name goes, or stays where the run did not come to its end."""
        self._stream.close()
        if kind is None:
            self._claim.complete()
        self._claim.release()

    def _at(self, progress: Progress) -> None:
        self.recording.set_time("samples", sequence=progress.samples)
        self.recording.set_time("training time", duration=60 * progress.minutes)


def training_blueprint() -> rrb.Blueprint:
    """Losses above, errors in degrees and centimetres below."""

    def plot(name: str, *contents: str) -> rrb.TimeSeriesView:
        return rrb.TimeSeriesView(name=name, contents=list(contents))

    training, held_out = f"/{entities.TRAINING}", f"/{entities.VALIDATION}"
    rotation = [f"{training}/rotation_deg"]
    rotation += [f"{held_out}/{name}_deg" for name in ("rotation", "rotation_p95", "initial_rotation")]
    translation = [f"{training}/translation_cm"]
    translation += [f"{held_out}/{name}_cm" for name in ("translation", "initial_translation")]
    losses = [f"{training}/**", f"- {training}/rotation_deg", f"- {training}/translation_cm"]
    return rrb.Blueprint(
        rrb.Vertical(
            plot("Losses (weighted)", *losses),
            rrb.Horizontal(plot("Rotation error, degrees", *rotation), plot("Translation error, cm", *translation)),
        ),
        rrb.TimePanel(timeline="samples"),
        collapse_panels=True,
    )
