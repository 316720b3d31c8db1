"""The state of a live session: the frame, the initial guess, the pose, and earlier tries.

Only the server's own thread changes it; long computations take their input from here and return their result to it.
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
"""Largest number of poses that can be undone."""


@runtime_checkable
class StagedCalibrator(DriveCalibrator, Protocol):
    """A method whose stages can also be run one at a time; `calibnet.cascade.cascade.Cascade` is one."""

    @property
    def numbers(self) -> tuple[int, ...]:
        """Numbers of the stages, coarse to fine."""
        ...

    def only(self, number: int) -> DriveCalibrator:
        """The same method with only this stage."""
        ...


class ReadByOne(PickedFrames):
    """Frames that only one thread reads at a time, since the server and the worker share the file of a bag."""

    def __init__(self, sequence: Sequence, positions: Positions[int]) -> None:
        super().__init__(sequence, positions)
        self._reading = threading.Lock()

    def __getitem__(self, position: int) -> Frame:
        """Read a frame once no other is being read."""
        with self._reading:
            return super().__getitem__(position)


class Workspace:
    """The state of a live session.

    Attributes:
        name: name of the sequence.
        frames: the selected frames.
        frame: the current frame.
        position: position of the current frame among the selected ones.
        pose: the pose to try, relative to `guess`.
        tries: all tries, in order.
    """

    def __init__(self, sequence: Sequence, positions: Positions[int], start: Start, seed: int = 0) -> None:
        """Start with the first frame.

        Args:
            sequence: the sequence of frames.
            positions: positions of the selected frames, in order.
            start: gives the guess of each frame and, if known, the reference.
            seed: seed of random poses.
        """
        self._start = start
        self.name, self.frames = sequence.name, ReadByOne(sequence, list(positions))
        self._random = np.random.default_rng([seed, 0, 1])  # not what the guess was drawn with
        self._undone: list[Pose] = []
        self._done: list[Pose] = []
        self.pose = Pose()
        self.tries: list[Try] = []
        self.show(0, self.frames[0])

    def show(self, position: int, frame: Frame) -> None:
        """Change the current frame; the pose stays, since the mount is the same."""
        self.position, self.frame = position, frame

    def guess_of(self, frame: Frame) -> Extrinsic:
        """Initial ``camera_from_lidar`` of a run on a frame."""
        return self._start.initial(frame)

    def reference_of(self, frame: Frame) -> Extrinsic | None:
        """The true ``camera_from_lidar`` of a frame; None if unknown."""
        return self._start.reference(frame)

    @property
    def guess(self) -> Extrinsic:
        """The guess of the current frame."""
        return self.guess_of(self.frame)

    @property
    def reference(self) -> Extrinsic | None:
        """The reference of the current frame; None if unknown."""
        return self.reference_of(self.frame)

    @property
    def extrinsic(self) -> Extrinsic:
        """``camera_from_lidar`` of the pose."""
        return self.pose.applied_to(self.guess)

    @property
    def can_undo(self) -> bool:
        """Whether a move can be undone."""
        return bool(self._done)

    @property
    def can_redo(self) -> bool:
        """Whether an undone move can be redone."""
        return bool(self._undone)

    def move(self, pose: Pose) -> None:
        """Set the pose; the previous one can be restored by `undo`."""
        if pose != self.pose:
            self._done = [*self._done, self.pose][-MOST_UNDONE:]
            self._undone.clear()
            self.pose = pose

    def undo(self) -> None:
        """Go back to the previous pose, if any."""
        if self._done:
            self._undone.append(self.pose)
            self.pose = self._done.pop()

    def redo(self) -> None:
        """Revert the last `undo`."""
        if self._undone:
            self._done.append(self.pose)
            self.pose = self._undone.pop()

    def move_to(self, extrinsic: Extrinsic) -> None:
        """Set the pose to an extrinsic."""
        self.move(Pose.between(extrinsic, self.guess))

    def move_randomly(self, range_: MiscalibrationRange) -> None:
        """Set the pose to a random miscalibration of the reference or, without one, of the guess."""
        around = self.guess if self.reference is None else self.reference
        self.move_to(sample_miscalibration(range_, self._random) @ around)

    def keep(self, make: Callable[[int], Try]) -> Try:
        """Keep a try under the next number."""
        made = make(len(self.tries))
        self.tries.append(made)
        return made
