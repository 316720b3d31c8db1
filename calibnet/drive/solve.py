"""One extrinsic from a drive: what the stages make of all frames together, then what their edges say of it."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from typing import Protocol

from calibnet.alignment import Evidence, gather
from calibnet.datasets.frame import Frame, Frames
from calibnet.drive.consensus import Consensus
from calibnet.errors import CalibrationError
from calibnet.geometry import MiscalibrationRange, is_finest
from calibnet.geometry.types import Extrinsic
from calibnet.trace import CascadeTrace, DriveEstimate, Estimate

FRAMES_UNTIL_LAST_LOOK = 24
"""Frames, spread over the drive, that all passes but the last look at."""
LOOKS = 2
"""Times that each stage corrects a sequence, on scans projected anew; the last one does so once more in the end."""
FRAMES_ALIGNED = 24
"""Frames, spread over the drive, whose edges are aligned: each keeps 4 MB of pictures until the end."""
CURVE_POINTS = 12
"""Of the curve that shows how an estimate converges over a drive."""


class OneStage(Protocol):
    """A cascade of one stage that looks once."""

    def calibrate(self, frame: Frame, initial: Extrinsic) -> CascadeTrace:
        """Correct the extrinsic of one frame."""
        ...


def solve_drive(
    stages: Sequence[tuple[MiscalibrationRange, OneStage]],
    frames: Frames,
    initial: Extrinsic,
    observer: Callable[[int, int], None] | None = None,
) -> DriveEstimate:
    """Correct the extrinsic that all frames share.

    Args:
        stages: coarse to fine, each with its range.
        frames: see `calibnet.cascade.Cascade.calibrate_drive`, as for the other arguments and errors.
        initial: ``camera_from_lidar``, 4x4.
        observer: called before each frame with the number of frames read and to be read.
    """
    if not len(frames):
        raise ValueError("There are no frames to calibrate.")
    some, everything = spread(len(frames), FRAMES_UNTIL_LAST_LOOK), list(range(len(frames)))
    total, number = LOOKS * len(stages) * len(some) + len(everything), itertools.count()

    def read(position: int) -> Frame:
        if observer is not None:
            observer(next(number), total)
        return frames[position]

    extrinsic = initial
    for range_, stage in stages:
        for _ in range(LOOKS):
            extrinsic = agree(range_, stage, read, some, extrinsic).estimate().camera_from_lidar

    range_, last = stages[-1]
    curve = Curve(len(everything), is_finest(range_))
    consensus = agree(range_, last, read, everything, extrinsic, curve.note)
    estimate = curve.end(consensus)
    return DriveEstimate(
        estimate.camera_from_lidar,
        estimate.covariance,
        estimate.frames,
        tuple(curve.points),
        skipped=len(everything) - len(consensus),
        networks=consensus.estimate() if curve.aligns else None,
    )


class Curve:
    """The estimate after more and more frames of the last pass.

    Attributes:
        aligns: whether edges are aligned; they pull no farther than what the finest stage leaves.
        points: index of a frame, and the estimate up to it.
    """

    def __init__(self, frames: int, aligns: bool) -> None:
        self.aligns, self.points = aligns, list[tuple[int, Estimate]]()
        self._evidence = list[Evidence]()
        self._to_align, self._to_note = spread(frames, FRAMES_ALIGNED), spread(frames, CURVE_POINTS)[:-1]
        self._latest = 0

    def note(self, position: int, frame: Frame, consensus: Consensus) -> None:
        """Take in one more frame, the last one of ``consensus``."""
        self._latest = frame.index
        if self.aligns and due(self._to_align, position):
            self._evidence.append(gather(frame, consensus.before))
        if due(self._to_note, position):
            self.points.append((frame.index, self._estimate(consensus, self._earlier)))

    def end(self, consensus: Consensus) -> Estimate:
        """The estimate of all frames; it is the last point of the curve."""
        final = self._estimate(consensus, [consensus.estimate(), *self._earlier])
        if self.points and self.points[-1][0] == self._latest:  # no frame after it could be calibrated
            self.points.pop()
        self.points.append((self._latest, final))
        return final

    @property
    def _earlier(self) -> list[Estimate]:
        return [estimate for _, estimate in self.points[-1:]]

    def _estimate(self, consensus: Consensus, starts: list[Estimate]) -> Estimate:
        return consensus.aligned(self._evidence, starts) if self.aligns else consensus.estimate()


def due(positions: list[int], position: int) -> bool:
    """Whether one of the sorted ``positions`` is reached; if so, those up to it are done.

    A frame that fails is made up for by the next one that does not.
    """
    reached = bool(positions) and positions[0] <= position
    while positions and positions[0] <= position:
        positions.pop(0)
    return reached


def agree(
    range_: MiscalibrationRange,
    stage: OneStage,
    read: Callable[[int], Frame],
    positions: list[int],
    extrinsic: Extrinsic,
    note: Callable[[int, Frame, Consensus], None] | None = None,
) -> Consensus:
    """What one stage makes of some frames of a drive; ``note`` is told after each that it could calibrate."""
    failure = None
    consensus = Consensus(extrinsic, range_.information)
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
