"""One extrinsic from a drive: what the stages make of all frames together, then what their edges say of it."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from calibnet.alignment import Evidence, gather
from calibnet.datasets.frame import Frame
from calibnet.errors import CalibrationError
from calibnet.geometry import RANGES, MiscalibrationRange
from calibnet.geometry.se3 import Matrix
from calibnet.network.pose import prior_information
from calibnet.sequence_estimate import Consensus, Estimate, SequenceEstimate
from calibnet.trace import CascadeTrace

FRAMES_UNTIL_LAST_PASS = 24
"""Frames, spread over the drive, that all passes but the last look at."""
PASSES = 2
"""Times that each stage corrects a sequence, on scans projected anew; the last one does so once more in the end."""
FRAMES_ALIGNED = 24
"""Frames, spread over the drive, whose edges are aligned; the estimate's curve has a point after each."""


class Frames(Protocol):
    """A drive: a `calibnet.datasets.Sequence`, or a list of frames."""

    def __len__(self) -> int:
        """Number of frames."""
        ...

    def __getitem__(self, position: int, /) -> Frame:
        """Read one frame."""
        ...


class OneStage(Protocol):
    """A cascade of one stage that looks once."""

    def calibrate(self, frame: Frame, initial: Matrix) -> CascadeTrace:
        """Correct the extrinsic of one frame."""
        ...


def solve_drive(
    stages: Sequence[tuple[MiscalibrationRange, OneStage]],
    frames: Frames,
    initial: Matrix,
    observer: Callable[[int, int], None] | None = None,
) -> SequenceEstimate:
    """See `calibnet.cascade.Cascade.calibrate_sequence`; ``stages`` coarse to fine, each with its range."""
    if not len(frames):
        raise ValueError("There are no frames to calibrate.")
    some, everything = spread(len(frames), FRAMES_UNTIL_LAST_PASS), list(range(len(frames)))
    total, number = PASSES * len(stages) * len(some) + len(everything), itertools.count()

    def read(position: int) -> Frame:
        if observer is not None:
            observer(next(number), total)
        return frames[position]

    extrinsic = initial
    for bounds, stage in stages:
        for _ in range(PASSES):
            extrinsic = agree(bounds, stage, read, some, extrinsic).estimate().camera_from_lidar

    bounds, last = stages[-1]
    aligned, aligns = set(spread(len(everything), FRAMES_ALIGNED)), bounds == RANGES[-1]
    evidence: list[Evidence] = []
    history: list[tuple[int, Estimate]] = []
    latest = 0

    def estimate(consensus: Consensus) -> Estimate:
        if not aligns:
            return consensus.estimate()
        return consensus.aligned(evidence, history[-1][1] if history else None)

    def note(position: int, frame: Frame, consensus: Consensus) -> None:
        nonlocal latest
        latest = frame.index
        if position in aligned:
            if aligns:  # edges pull no farther than what the finest stage leaves
                evidence.append(gather(frame, consensus.before))
            history.append((frame.index, estimate(consensus)))

    consensus = agree(bounds, last, read, everything, extrinsic, note)
    if not history or history[-1][1].frames < len(consensus):  # frames at the end could not be calibrated
        history.append((latest, estimate(consensus)))
    final = history[-1][1]
    return SequenceEstimate(
        final.camera_from_lidar,
        final.covariance,
        final.frames,
        tuple(history),
        skipped=len(everything) - len(consensus),
        networks=consensus.estimate() if aligns else None,
    )


def agree(
    bounds: MiscalibrationRange,
    stage: OneStage,
    read: Callable[[int], Frame],
    positions: list[int],
    extrinsic: Matrix,
    note: Callable[[int, Frame, Consensus], None] | None = None,
) -> Consensus:
    """What one stage makes of some frames of a drive; ``note`` is told after each that it could calibrate."""
    failure = None
    consensus = Consensus(extrinsic, np.diag(prior_information(bounds).double().numpy()))
    for position in positions:
        frame = read(position)
        try:
            trace = confirmed(stage.calibrate(frame, extrinsic), frame).stages[0]
        except CalibrationError as error:
            failure = error
            continue
        consensus.add(trace.correction, trace.information)
        if note is not None:
            note(position, frame, consensus)
    if failure is not None and not len(consensus):
        raise failure
    return consensus


def confirmed(trace: CascadeTrace, frame: Frame) -> CascadeTrace:
    """The trace, if picture and scan fit together.

    Raises:
        CalibrationError: they do not.
    """
    if not trace.confirmed:
        last, limit = trace.stages[-1], trace.match_error_limit_px
        raise CalibrationError(
            f"Picture and scan of frame {frame.index} ({frame.source}) do not fit together after stage {last.number}, "
            f"which expects its matches to be {last.match_error_px:.1f} px off (at most {limit:g}): "
            "check that they belong together and that the start is within the range of the first stage."
        )
    return trace


def spread(count: int, most: int) -> list[int]:
    """At most ``most`` of the positions 0 to ``count - 1``, evenly spread, the last always among them."""
    chosen = min(count, most)
    return [(number + 1) * count // chosen - 1 for number in range(chosen)]
