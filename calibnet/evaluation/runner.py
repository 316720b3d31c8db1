"""Measures single frames: calibrates each from seeded miscalibrations and summarises the errors."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from calibnet.calibrator import Calibrator
from calibnet.datasets import Sequence as FrameSequence
from calibnet.errors import CalibrationError, DatasetError
from calibnet.evaluation.claims import Claims
from calibnet.evaluation.coverage import Coverage, squared_error
from calibnet.evaluation.metrics import Metrics
from calibnet.geometry import MiscalibrationRange, PoseError, pose_error, sample_miscalibration
from calibnet.geometry.types import Transform
from calibnet.verdict import ACCEPTED, CANNOT_TELL, FRAME_TOLERANCES, WORDS, Tolerance


@dataclass(frozen=True)
class Run:
    """One frame, calibrated from one miscalibration.

    Attributes:
        sequence: name of the frame's sequence.
        frame: index of the frame in it.
        repeat: number of the frame's miscalibration, from 0.
        initial: error before the first stage.
        stages: error after each stage that ran, by stage number, whatever the verdict; empty if the frame could not be
            calibrated.
        applied: error of the result that is applied, which is the initial extrinsic if the result is rejected.
        verdict: accepted, rejected or cannot tell; empty without a verdict.
        squared_error: normalised squared error, see `calibnet.evaluation.coverage`; NaN without a covariance.
        within: the tolerance that the verdict is certain of; None if it is certain of none.
    """

    sequence: str
    frame: int
    repeat: int
    initial: PoseError
    stages: dict[int, PoseError]
    applied: PoseError
    verdict: str = ""
    squared_error: float = math.nan
    within: Tolerance | None = None


Observer = Callable[[Run], None]
"""Called after every run, for progress."""


@dataclass(frozen=True)
class StageMetrics:
    """Errors after one stage."""

    number: int
    range: MiscalibrationRange
    metrics: Metrics


@dataclass(frozen=True)
class Evaluation:
    """The measured errors, before the cascade and after each stage.

    Attributes:
        sequences: names of the sequences.
        rig: their sensors; those of several rigs are joined by semicolons.
        range: range of the miscalibrations.
        repeats: miscalibrations per frame.
        seed: seed of the miscalibrations.
        frames: number of frames.
        failed: number of runs in which a frame could not be calibrated; they count with their initial error.
        initial: errors before the first stage.
        stages: errors after each stage that ran, coarse to fine.
        runs: the single runs.
        drives: errors of drives, each solved from all its frames; None if none was measured.
        drives_networks: errors of drives before edges were aligned; None if none were aligned.
        drives_coverage: how the stated covariances of drives compare with their errors; None without covariances.
        drives_verdicts: number of drives with each verdict.
        drives_claims: how many drives are certain of the coarser tolerance; None if none was measured.
        references: errors of other methods on the same single frames, by name, also without any correction.
        audit: errors of the applied results on altered frames, by alteration, see `calibnet.evaluation.audit`.
        audit_arrived: errors after the last stage, whatever the verdict, by alteration.
        audit_rejected: number of rejected runs, by alteration.
        audit_images: names of the sequences that the swapped images come from.
    """

    sequences: tuple[str, ...]
    rig: str
    range: MiscalibrationRange
    repeats: int
    seed: int
    frames: int
    failed: int
    initial: Metrics
    stages: tuple[StageMetrics, ...]
    runs: tuple[Run, ...] = field(repr=False)
    drives: Metrics | None = None
    drives_networks: Metrics | None = None
    drives_coverage: Coverage | None = None
    drives_verdicts: dict[str, int] = field(default_factory=dict)
    drives_claims: Claims | None = None
    references: dict[str, Metrics] = field(default_factory=dict)
    audit: dict[str, Metrics] = field(default_factory=dict)
    audit_arrived: dict[str, Metrics] = field(default_factory=dict)
    audit_rejected: dict[str, int] = field(default_factory=dict)
    audit_images: str = ""

    @property
    def verdicts(self) -> dict[str, int]:
        """Number of runs with each verdict."""
        return {word: sum(run.verdict == word for run in self.runs) for word in WORDS}

    @property
    def claims(self) -> Claims:
        """How many runs are certain of the coarser tolerance of frames, and how many wrongly."""
        return Claims.of(FRAME_TOLERANCES[-1], [(run.within, run.applied) for run in self.runs])

    @property
    def accepted(self) -> Metrics | None:
        """Errors of the accepted runs; None without accepted runs."""
        errors = [run.applied for run in self.runs if run.verdict == ACCEPTED]
        return Metrics.of(errors) if errors else None

    @property
    def coverage(self) -> Coverage | None:
        """How the stated covariances of runs that are not rejected compare with their errors."""
        return Coverage.of(run.squared_error for run in self.runs if run.verdict in (ACCEPTED, CANNOT_TELL))

    @property
    def coverage_accepted(self) -> Coverage | None:
        """How the stated covariances of accepted runs compare with their errors."""
        return Coverage.of(run.squared_error for run in self.runs if run.verdict == ACCEPTED)

    @property
    def applied(self) -> Metrics:
        """Errors of the applied results."""
        return Metrics.of([run.applied for run in self.runs])

    @property
    def final(self) -> Metrics:
        """Errors after the last stage, whatever the verdict."""
        return self.stages[-1].metrics

    def as_dict(self) -> dict[str, Any]:
        """The content of JSON files, without the single runs."""
        content: dict[str, Any] = {
            "sequences": list(self.sequences),
            "rig": self.rig,
            "range": str(self.range),
            "repeats": self.repeats,
            "seed": self.seed,
            "frames": self.frames,
            "failed": self.failed,
            "verdicts": {word.replace(" ", "_"): count for word, count in self.verdicts.items()},
            "claims": self.claims.as_dict(),
            "accepted": None if self.accepted is None else self.accepted.as_dict(),
            "initial": self.initial.as_dict(),
            "stages": [
                {"number": stage.number, "range": str(stage.range), **stage.metrics.as_dict()} for stage in self.stages
            ],
            "sequence": None if self.drives is None else self.drives.as_dict(),
            "coverage": None if self.coverage is None else self.coverage.as_dict(),
            "coverage_accepted": None if self.coverage_accepted is None else self.coverage_accepted.as_dict(),
            "coverage_sequence": None if self.drives_coverage is None else self.drives_coverage.as_dict(),
            "verdicts_sequence": {word.replace(" ", "_"): count for word, count in self.drives_verdicts.items()},
            "claims_sequence": None if self.drives_claims is None else self.drives_claims.as_dict(),
            "sequence_networks": None if self.drives_networks is None else self.drives_networks.as_dict(),
            "references": {name: metrics.as_dict() for name, metrics in self.references.items()},
        }
        if self.audit:
            content["audit"] = {name: metrics.as_dict() for name, metrics in self.audit.items()}
            content["audit_arrived"] = {name: metrics.as_dict() for name, metrics in self.audit_arrived.items()}
            content["audit_rejected"] = self.audit_rejected
            content["audit_images"] = self.audit_images
        return content


def draw_miscalibration(range_: MiscalibrationRange, seed: int, frame: int, repeat: int) -> Transform:
    """The ``delta`` of one run, which does not depend on what else is measured or in which order."""
    return sample_miscalibration(range_, np.random.default_rng([seed, frame, repeat]))


def evaluate_frames(
    calibrator: Calibrator,
    sequences: Sequence[FrameSequence],
    range_: MiscalibrationRange,
    repeats: int,
    seed: int,
    observer: Observer | None = None,
) -> Evaluation:
    """Calibrate every frame of ``sequences`` from ``repeats`` miscalibrations each.

    Args:
        calibrator: the calibrator to measure.
        sequences: sequences with the frames, whose extrinsics are the reference.
        range_: range of the miscalibrations.
        repeats: miscalibrations per frame, at least 1.
        seed: seed of the miscalibrations.
        observer: called after every run.

    Raises:
        DatasetError: there is no frame to measure on, or one cannot be read.
        CalibrationError: no frame could be calibrated.
    """
    runs: list[Run] = []
    ranges: dict[int, MiscalibrationRange] = {}
    failure: CalibrationError | None = None
    for sequence in sequences:
        for frame in sequence:
            reference = frame.camera_from_lidar
            for repeat in range(repeats):
                initial = draw_miscalibration(range_, seed, frame.index, repeat) @ reference
                errors: dict[int, PoseError] = {}
                applied, verdict, square, within = initial, "", math.nan, None
                try:
                    trace = calibrator.calibrate(frame, initial)
                    for stage in trace.stages:
                        ranges[stage.number] = stage.range
                        errors[stage.number] = pose_error(stage.after, reference)
                    applied, verdict = trace.corrected, trace.verdict.word if trace.verdict else ""
                    stated, within = (trace.verdict.covariance, trace.verdict.within) if trace.verdict else (None, None)
                    square = squared_error(trace.arrived, reference, stated)
                except CalibrationError as error:
                    failure = error
                before, after = (pose_error(extrinsic, reference) for extrinsic in (initial, applied))
                runs.append(Run(sequence.name, frame.index, repeat, before, errors, after, verdict, square, within))
                if observer is not None:
                    observer(runs[-1])
    if not runs:
        raise DatasetError("There are no frames to evaluate; check the sequences and the frame selection.")
    if not ranges:
        raise failure or CalibrationError("No stage of the cascade ran, so there is nothing to measure.")
    return Evaluation(
        sequences=tuple(sequence.name for sequence in sequences),
        rig="; ".join(dict.fromkeys(sequence.rig for sequence in sequences)),
        range=range_,
        repeats=repeats,
        seed=seed,
        frames=len(runs) // repeats,
        failed=sum(not run.stages for run in runs),
        initial=Metrics.of([run.initial for run in runs]),
        stages=tuple(
            StageMetrics(number, ranges[number], Metrics.of([run.stages.get(number, run.initial) for run in runs]))
            for number in sorted(ranges)
        ),
        runs=tuple(runs),
    )
