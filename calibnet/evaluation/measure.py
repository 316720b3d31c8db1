"""The measurement that documents quote: `measure` computes all rows of the table that ``evaluate`` prints."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

from calibnet.calibrator import Calibrator, DriveCalibrator, drives_only
from calibnet.datasets import Sequence
from calibnet.errors import CalibrationError
from calibnet.evaluation.audit import Altered, alterations, other_drive
from calibnet.evaluation.drives import evaluate_drives
from calibnet.evaluation.metrics import Metrics
from calibnet.evaluation.runner import Evaluation, evaluate_frames
from calibnet.geometry import MiscalibrationRange
from calibnet.methods.edge_alignment import EdgeAlignment
from calibnet.verdict import REJECTED

NO_CORRECTION = "no correction"


class Step(NamedTuple):
    """The progress of a measurement.

    Attributes:
        row: what is being measured, in words.
        done: number of finished runs on frames of this row; 0 before the first.
        total: number of all runs of this row; None if it is not known beforehand.
        sequence: name of the sequence of the last run; empty before the first.
    """

    row: str
    done: int
    total: int | None
    sequence: str


Observer = Callable[[Step], None]
"""Called before a row, and after each of its runs on a frame."""


def measure(
    cascade: DriveCalibrator,
    sequences: list[Sequence],
    range_: MiscalibrationRange,
    repeats: int = 1,
    seed: int = 0,
    *,
    references: Mapping[str, Calibrator] | None = None,
    drives: bool = True,
    audit: bool = False,
    beside: Callable[[], Iterable[Sequence]] = tuple,
    observer: Observer | None = None,
) -> Evaluation:
    """Measure a cascade on single frames and on drives, and the methods that it is compared with.

    The same arguments give the same figures: miscalibrations depend only on the seed, the frame's index and the repeat.

    Args:
        cascade: the cascade to measure, for instance ``Cascade.load(stages=stages_within(range_))``.
        sequences: sequences with the frames, whose extrinsics are the reference.
        range_: range of the miscalibrations.
        repeats: miscalibrations per frame and per drive, at least 1.
        seed: seed of the miscalibrations.
        references: other methods by name, measured on the same single frames; by default `EdgeAlignment`, which needs
            no training.
        drives: whether the extrinsic of every drive is solved from all its frames too.
        audit: whether single frames are also measured with another image, a grey one, and with fewer LiDAR rings, see
            `calibnet.evaluation.audit`.
        beside: opens further sequences that the audit may take images from.
        observer: called with the progress.

    Raises:
        DatasetError: there is no frame to measure on, or one cannot be read.
        CalibrationError: no frame could be calibrated.
    """
    measurement = _Measurement(sequences, range_, repeats, seed, observer or (lambda step: None))
    evaluation = measurement.frames("single frames", cascade)
    held_against = {NO_CORRECTION: evaluation.initial}
    for name, method in (classical(range_) if references is None else references).items():
        held_against[name] = measurement.held_against(name, method)
    evaluation = replace(evaluation, references=held_against)
    if drives:
        evaluation = measurement.with_drives(evaluation, cascade)
    return measurement.with_audit(evaluation, cascade, beside) if audit else evaluation


def classical(range_: MiscalibrationRange) -> dict[str, Calibrator]:
    """The method without training that networks are compared with, by the name that tables and JSON use."""
    return {"edge alignment": EdgeAlignment(range_)}


@dataclass(frozen=True)
class _Measurement:
    """The arguments that all rows share; each method measures one kind of row."""

    sequences: list[Sequence]
    range: MiscalibrationRange
    repeats: int
    seed: int
    observer: Observer

    def frames(self, row: str, calibrator: Calibrator, sequences: list[Sequence] | None = None) -> Evaluation:
        """Measure every frame by itself."""
        chosen = self.sequences if sequences is None else sequences
        advance = self._counter(row, self.repeats * sum(map(len, chosen)))
        return evaluate_frames(
            calibrator, chosen, self.range, self.repeats, self.seed, observer=lambda run: advance(run.sequence)
        )

    def held_against(self, row: str, method: Calibrator) -> Metrics:
        """Measure another method on single frames, or on drives if it only solves drives."""
        if not drives_only(method):
            return self.frames(row, method).final
        assert isinstance(method, DriveCalibrator)
        advance = self._counter(row, None)
        solved = evaluate_drives(
            method, self.sequences, self.range, self.repeats, self.seed, lambda name, *_: advance(name)
        )
        if solved is None:
            raise CalibrationError(f"{row} needs drives of several frames on one mount; give such data.")
        return solved.estimate

    def with_drives(self, evaluation: Evaluation, cascade: DriveCalibrator) -> Evaluation:
        """Measure every drive, solved from all its frames."""
        advance = self._counter("drives", None)
        solved = evaluate_drives(
            cascade, self.sequences, self.range, self.repeats, self.seed, lambda name, *_: advance(name)
        )
        if solved is None:
            return evaluation
        return replace(
            evaluation,
            drives=solved.estimate,
            drives_networks=solved.networks,
            drives_coverage=solved.coverage,
            drives_verdicts=solved.verdicts,
            drives_claims=solved.claims,
        )

    def with_audit(
        self, evaluation: Evaluation, cascade: Calibrator, beside: Callable[[], Iterable[Sequence]]
    ) -> Evaluation:
        """Measure every frame by itself with each of the alterations."""
        donors = [other_drive(sequence, self.sequences, beside) for sequence in self.sequences]
        altered = {}
        for name in alterations(donors[0]):
            sequences: list[Sequence] = [
                Altered(sequence, alterations(donor)[name])
                for sequence, donor in zip(self.sequences, donors, strict=True)
            ]
            altered[name] = self.frames(f"audit, {name}", cascade, sequences)
        return replace(
            evaluation,
            audit={name: row.applied for name, row in altered.items()},
            audit_arrived={name: row.final for name, row in altered.items()},
            audit_rejected={name: row.verdicts[REJECTED] for name, row in altered.items()},
            audit_images=", ".join(dict.fromkeys(donor.name for donor in donors)),
        )

    def _counter(self, row: str, total: int | None) -> Callable[[str], None]:
        """Announce a row; returns a function to call after every run on a frame, with the sequence's name."""
        done = 0
        self.observer(Step(row, done, total, ""))

        def advance(sequence: str) -> None:
            nonlocal done
            done += 1
            self.observer(Step(row, done, total, sequence))

        return advance
