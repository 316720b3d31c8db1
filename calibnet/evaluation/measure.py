"""The measurement whose figures documents quote: `measure` makes every row of the table that ``evaluate`` prints."""

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
    """How far a measurement is.

    Attributes:
        row: what is being measured, for people.
        done: runs on frames of this row so far; 0 once before the first.
        total: of them; None where it is not known beforehand.
        sequence: name of the sequence that the last of them is from; empty before the first.
    """

    row: str
    done: int
    total: int | None
    sequence: str


Observer = Callable[[Step], None]
"""Called before a row and after every run on a frame of it."""


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
    """Measure a cascade on single frames and on drives, and what it is held against.

    The same arguments give the same figures: miscalibrations depend on the seed, the frame's index and the repeat.

    Args:
        cascade: what to measure, for instance ``Cascade.load(stages=stages_within(range_))``.
        sequences: where the frames come from; their own extrinsics are the reference.
        range_: range of the miscalibrations.
        repeats: miscalibrations a frame and a drive, at least 1.
        seed: of the miscalibrations.
        references: other methods by name, measured on the same single frames; by default `EdgeAlignment`, which needs
            no training.
        drives: whether the extrinsic of every drive is solved from all its frames, too.
        audit: whether the single frames are measured again with the image swapped, grey, and with fewer LiDAR rings,
            see `calibnet.evaluation.audit`.
        beside: opens what else the audit may take images of another drive from.
        observer: told how far it is.

    Raises:
        DatasetError: when there is no frame to measure on, or one cannot be read.
        CalibrationError: when not a single frame could be calibrated.
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
    """The refinement without training that networks are held against, by the name that tables and JSON use."""
    return {"edge alignment": EdgeAlignment(range_)}


@dataclass(frozen=True)
class _Measurement:
    """What all rows have in common; one method a kind of row."""

    sequences: list[Sequence]
    range: MiscalibrationRange
    repeats: int
    seed: int
    observer: Observer

    def frames(self, row: str, calibrator: Calibrator, sequences: list[Sequence] | None = None) -> Evaluation:
        """Every frame by itself."""
        chosen = self.sequences if sequences is None else sequences
        advance = self._counter(row, self.repeats * sum(map(len, chosen)))
        return evaluate_frames(
            calibrator, chosen, self.range, self.repeats, self.seed, observer=lambda run: advance(run.sequence)
        )

    def held_against(self, row: str, method: Calibrator) -> Metrics:
        """Another method on single frames or, where it knows whole drives alone, on the drives."""
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
        """Every drive from all its frames."""
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
        """Every frame by itself, altered in each of the ways."""
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
        """Announce a row; returns what to call after every run on a frame, with the frame's sequence."""
        done = 0
        self.observer(Step(row, done, total, ""))

        def advance(sequence: str) -> None:
            nonlocal done
            done += 1
            self.observer(Step(row, done, total, sequence))

        return advance
