"""Table 2 of the paper, measured: every method on the same frames, miscalibrations and rigs (`measure_bench`)."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from calibnet.calibrator import Calibrator, DriveCalibrator, drives_only
from calibnet.datasets import Frame, PickedFrames
from calibnet.datasets import Sequence as FrameSequence
from calibnet.datasets.selection import by_rig, evenly_spaced
from calibnet.errors import CalibnetError, CalibrationError, ConfigError
from calibnet.evaluation.audit import Altered, alterations, other_drive
from calibnet.evaluation.drives import shares_mount
from calibnet.evaluation.metrics import Metrics
from calibnet.evaluation.published import PUBLISHED
from calibnet.evaluation.runner import draw_miscalibration
from calibnet.geometry import MiscalibrationRange, PoseError, pose_error
from calibnet.geometry.types import Extrinsic
from calibnet.methods.card import card_of

FRAMES, DRIVES = "frames", "drives"
AUDITED = ("grey", "swapped")
"""The alterations of `calibnet.evaluation.audit` that every method is measured on."""
TIMED = 3
"""Number of frames whose median time is the latency of a method, after one that is not timed."""


class BenchMethod(NamedTuple):
    """A method of the table: its name, and a function that opens it for a range."""

    name: str
    open: Callable[[MiscalibrationRange], Calibrator]


@dataclass(frozen=True)
class Bench:
    """The frames and miscalibrations that all methods are measured on.

    Attributes:
        sequences: sequences with the frames, whose extrinsics are the reference.
        ranges: ranges of the miscalibrations; the audit uses the first.
        repeats: miscalibrations per frame and per drive.
        seed: seed of the miscalibrations.
        most: largest number of frames per sequence, evenly spaced, and of successive frames per drive.
        limit_s: seconds after which a row ends with the runs done so far.
        audit: whether altered frames are measured too.
        beside: opens further sequences that the audit may take images from.
    """

    sequences: list[FrameSequence]
    ranges: tuple[MiscalibrationRange, ...]
    repeats: int = 1
    seed: int = 0
    most: int = 12
    limit_s: float = 300.0
    audit: bool = True
    beside: Callable[[], Iterable[FrameSequence]] = field(default=tuple)

    @property
    def rigs(self) -> dict[str, list[FrameSequence]]:
        """The sequences by rig."""
        return by_rig(self.sequences)


class Step(NamedTuple):
    """The progress of a measurement: the row, the number of its runs that are done, and the largest number of them."""

    row: str
    done: int
    total: int


Observer = Callable[[Step], None]


def measure_bench(
    bench: Bench, bench_methods: Sequence[BenchMethod], observer: Observer | None = None
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Measure methods one after the other.

    Yields:
        The name of each method and its entry in the table, as soon as it is measured. A method or row that cannot be
        measured has a sentence ``why`` instead of figures.

    Raises:
        DatasetError: a frame cannot be read.
    """
    for bench_method in bench_methods:
        yield bench_method.name, _entry(bench, bench_method, observer or (lambda step: None))


def initial_rows(bench: Bench) -> Iterator[dict[str, Any]]:
    """The initial errors of single frames, which a method has to improve on.

    Raises:
        DatasetError: a frame cannot be read.
    """
    for range_ in bench.ranges:
        for rig, sequences in bench.rigs.items():
            errors = [pose_error(one.initial, one.reference) for one in _frames(bench, range_, sequences)]
            if errors:
                yield {"range": str(range_), "rig": rig, "runs": len(errors), **Metrics.of(errors).as_dict()}


def _entry(bench: Bench, bench_method: BenchMethod, observer: Observer) -> dict[str, Any]:
    entry: dict[str, Any] = {"parameters": None, "multiply_adds": None, "latency_ms": None, "samples_trained": None}
    entry |= {"trained_on": [], "rows": [], "audit": {}}
    entry["claims"] = [one.as_dict() for one in PUBLISHED.get(bench_method.name, ())]
    for position, range_ in enumerate(bench.ranges):
        try:
            method = bench_method.open(range_)
        except CalibnetError as error:
            entry["rows"].append({"range": str(range_), "rig": "", "in_rig": None, "why": str(error)})
            continue
        card = card_of(method)
        if entry["parameters"] is None:
            entry |= {
                "parameters": card.parameters,
                "multiply_adds": card.multiply_adds,
                "samples_trained": card.samples_trained,
                "trained_on": list(card.trained_on),
                "latency_ms": latency(bench, method, range_),
                "costs_of": str(range_),
            }
        for rig, sequences in bench.rigs.items():
            for of in kinds(method):
                told = _telling(observer, f"{bench_method.name}, {range_}, {of} of {rig}")
                row = measure_row(bench, method, range_, sequences, of, told)
                entry["rows"].append({"range": str(range_), "rig": rig, "in_rig": card.knows(rig), "of": of, **row})
        if bench.audit and position == 0:
            entry["audit"] = {"range": str(range_)} | {
                name: measure_row(
                    bench, method, range_, altered, kinds(method)[0], _telling(observer, f"{bench_method.name}, {name}")
                )
                for name, altered in _altered(bench).items()
            }
    return entry


def kinds(method: Calibrator) -> tuple[str, ...]:
    """Whether a method can be measured on frames, on drives or on both."""
    if drives_only(method):
        return (DRIVES,)
    return (FRAMES, DRIVES) if isinstance(method, DriveCalibrator) else (FRAMES,)


class _Try(NamedTuple):
    """A run: its initial extrinsic, the reference, and the function that makes it."""

    initial: Extrinsic
    reference: Extrinsic
    run: Callable[[Calibrator, Extrinsic], tuple[Extrinsic, bool]]


def measure_row(
    bench: Bench,
    method: Calibrator,
    range_: MiscalibrationRange,
    sequences: Sequence[FrameSequence],
    of: str,
    told: Callable[[int, int], None],
) -> dict[str, Any]:
    """Errors of a method on single frames or on drives; refused runs count with their initial error.

    Returns:
        The figures, the number of runs, and the number refused: not calibrated, or rejected by the method. Without any
        run, or with all refused, a sentence ``why``.
    """
    tries = list(_frames(bench, range_, sequences) if of == FRAMES else _drives(bench, range_, sequences))
    errors: list[PoseError] = []
    refused, why, began = 0, "", time.monotonic()
    told(0, len(tries))
    for done, one in enumerate(tries, start=1):
        result = one.initial
        try:
            result, rejected = one.run(method, one.initial)
            refused += rejected
        except (CalibrationError, ConfigError) as error:  # the frame, or an option, does not suit the method
            refused, why = refused + 1, str(error)
        errors.append(pose_error(result, one.reference))
        told(done, len(tries))
        if time.monotonic() - began > bench.limit_s:
            break
    if not errors:
        return {"runs": 0, "refused": 0, "why": "None of the data is a drive of several frames on one mount."}
    row: dict[str, Any] = {"runs": len(errors), "of_runs": len(tries), "refused": refused}
    if refused == len(errors):
        return row | {"why": why or "The method rejects all its results."}
    return row | Metrics.of(errors).as_dict()


def _frames(bench: Bench, range_: MiscalibrationRange, sequences: Sequence[FrameSequence]) -> Iterator[_Try]:
    for sequence in sequences:
        for position in evenly_spaced(len(sequence), bench.most):
            frame = sequence[position]
            for repeat in range(bench.repeats):
                delta = draw_miscalibration(range_, bench.seed, frame.index, repeat)
                yield _Try(delta @ frame.camera_from_lidar, frame.camera_from_lidar, partial(_on_frame, frame))


def _on_frame(frame: Frame, method: Calibrator, initial: Extrinsic) -> tuple[Extrinsic, bool]:
    trace = method.calibrate(frame, initial)
    return trace.corrected, trace.rejected


def _drives(bench: Bench, range_: MiscalibrationRange, sequences: Sequence[FrameSequence]) -> Iterator[_Try]:
    for number, sequence in enumerate(sequences):
        if not shares_mount(sequence):
            continue
        first = max(0, (len(sequence) - bench.most) // 2)
        drive = PickedFrames(sequence, range(first, min(len(sequence), first + bench.most)))
        reference = drive[0].camera_from_lidar
        for repeat in range(bench.repeats):
            delta = draw_miscalibration(range_, bench.seed, number, repeat + 1000)
            yield _Try(delta @ reference, reference, partial(_on_drive, drive))


def _on_drive(drive: FrameSequence, method: Calibrator, initial: Extrinsic) -> tuple[Extrinsic, bool]:
    assert isinstance(method, DriveCalibrator)
    estimate = method.calibrate_drive(drive, initial)
    rejected = estimate.verdict is not None and estimate.verdict.word == "rejected"
    return initial if rejected else estimate.camera_from_lidar, rejected


def latency(bench: Bench, method: Calibrator, range_: MiscalibrationRange) -> float | None:
    """Median milliseconds of a method per frame; None if it only solves drives, or fails on all frames."""
    sequence = bench.sequences[0]
    if drives_only(method):
        return None
    positions = evenly_spaced(len(sequence), TIMED)
    times = []
    for count, position in enumerate([positions[0], *positions]):
        frame = sequence[position]
        initial = draw_miscalibration(range_, bench.seed, frame.index, 0) @ frame.camera_from_lidar
        began = time.perf_counter()
        try:
            method.calibrate(frame, initial)
        except (CalibrationError, ConfigError):
            continue
        if count:
            times.append(1000 * (time.perf_counter() - began))
    return float(np.median(times)) if times else None


def _altered(bench: Bench) -> dict[str, list[FrameSequence]]:
    """The sequences with each of the alterations."""
    donors = [other_drive(sequence, bench.sequences, bench.beside) for sequence in bench.sequences]
    return {
        name: [
            Altered(sequence, alterations(donor)[name]) for sequence, donor in zip(bench.sequences, donors, strict=True)
        ]
        for name in AUDITED
    }


def _telling(observer: Observer, row: str) -> Callable[[int, int], None]:
    return lambda done, total: observer(Step(row, done, total))
