"""The state of a live session: the frame, the guess it began with, the pose that is tried, and earlier tries.

Only the server's own thread touches it; what takes long gets its input from here and brings its result back.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from collections.abc import Sequence as Positions
from typing import Protocol, runtime_checkable

import numpy as np

from calibnet.calibrator import DriveCalibrator
from calibnet.datasets.frame import Frame, Sequence
from calibnet.datasets.selection import PickedFrames
from calibnet.geometry import MiscalibrationRange, sample_miscalibration
from calibnet.geometry.types import Extrinsic
from inspector.live.pose import Pose
from inspector.live.tries import Try
from inspector.run.start import Start

MOST_UNDONE = 1000
"""Poses that can be gone back through."""


@runtime_checkable
class StagedCalibrator(DriveCalibrator, Protocol):
    """A method whose stages can also be run one at a time; `calibnet.cascade.cascade.Cascade` is one."""

    @property
    def numbers(self) -> tuple[int, ...]:
        """Numbers of the stages, coarse to fine."""
        ...

    def only(self, number: int) -> DriveCalibrator:
        """The same with this stage alone."""
        ...


class ReadByOne(PickedFrames):
    """Frames that one thread reads at a time: the server and the worker share the file of a bag."""

    def __init__(self, sequence: Sequence, positions: Positions[int]) -> None:
        super().__init__(sequence, positions)
        self._reading = threading.Lock()

    def __getitem__(self, position: int) -> Frame:
        """Read a frame when no other is being read."""
        with self._reading:
            return super().__getitem__(position)


class Workspace:
    """The state of a live session.

    Attributes:
        name: of the sequence.
        frames: the chosen frames.
        frame: at hand.
        position: of it among the chosen frames.
        pose: that is tried, relative to `guess`.
        tries: what came of every try, in their order.
    """

    def __init__(self, sequence: Sequence, positions: Positions[int], start: Start, seed: int = 0) -> None:
        """Begin with the first frame.

        Args:
            sequence: where frames come from.
            positions: which of them, in order.
            start: gives the guess of each frame and, where it is known, the reference.
            seed: of random poses.
        """
        self._start = start
        self.name, self.frames = sequence.name, ReadByOne(sequence, list(positions))
        self._random = np.random.default_rng(seed)
        self._undone: list[Pose] = []
        self._done: list[Pose] = []
        self.pose = Pose()
        self.tries: list[Try] = []
        self.show(0, self.frames[0])

    def show(self, position: int, frame: Frame) -> None:
        """Put another frame on the workspace; the pose stays, for the mount is the same."""
        self.position, self.frame = position, frame

    def guess_of(self, frame: Frame) -> Extrinsic:
        """``camera_from_lidar`` that a run would start from on a frame."""
        return self._start.initial(frame)

    def reference_of(self, frame: Frame) -> Extrinsic | None:
        """The true one of a frame, where it is known."""
        return self._start.reference(frame)

    @property
    def guess(self) -> Extrinsic:
        """That of the frame at hand."""
        return self.guess_of(self.frame)

    @property
    def reference(self) -> Extrinsic | None:
        """That of the frame at hand."""
        return self.reference_of(self.frame)

    @property
    def extrinsic(self) -> Extrinsic:
        """``camera_from_lidar`` of the pose that is tried."""
        return self.pose.applied_to(self.guess)

    @property
    def can_undo(self) -> bool:
        """Whether there is a pose to go back to."""
        return bool(self._done)

    @property
    def can_redo(self) -> bool:
        """Whether going back can be taken back."""
        return bool(self._undone)

    def move(self, pose: Pose) -> None:
        """Try another pose; that of before can be gone back to."""
        if pose != self.pose:
            self._done = [*self._done, self.pose][-MOST_UNDONE:]
            self._undone.clear()
            self.pose = pose

    def undo(self) -> None:
        """Go back to the pose of before, if there is one."""
        if self._done:
            self._undone.append(self.pose)
            self.pose = self._done.pop()

    def redo(self) -> None:
        """Take back the last `undo`."""
        if self._undone:
            self._done.append(self.pose)
            self.pose = self._undone.pop()

    def move_to(self, extrinsic: Extrinsic) -> None:
        """Try an extrinsic."""
        self.move(Pose.between(extrinsic, self.guess))

    def move_randomly(self, range_: MiscalibrationRange) -> None:
        """Try a miscalibration of the reference or, where there is none, of the guess."""
        around = self.guess if self.reference is None else self.reference
        self.move_to(sample_miscalibration(range_, self._random) @ around)

    def keep(self, make: Callable[[int], Try]) -> Try:
        """Take in what a try came to, under the next number."""
        made = make(len(self.tries))
        self.tries.append(made)
        return made
