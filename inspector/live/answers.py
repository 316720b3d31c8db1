"""Long computations of a live session: running stages, solving the drive, finding the worst frame.

Each is a job of the session's worker. An answer is shown before it is recorded; its details, which cost as much again,
are computed stage by stage and recorded when nobody waits.
"""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Awaitable, Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calibnet.calibrator import Calibrator, DriveCalibrator
from calibnet.datasets.frame import Frame
from calibnet.datasets.selection import evenly_spaced
from calibnet.errors import CalibrationError, ConfigError, DatasetError
from calibnet.geometry import pose_error
from calibnet.geometry.types import Extrinsic
from calibnet.trace import CascadeTrace, DriveEstimate, StageTrace
from inspector.live.stream import TryRecording
from inspector.live.tries import Try
from inspector.live.worker import Job, Worker
from inspector.live.workspace import StagedCalibrator, Workspace
from inspector.record.observation import Observation
from inspector.record.pictures.matches import point_at

MOST_SEARCHED = 24
"""Number of frames, spread over the drive, among which the worst is searched."""
REACH_PX = 12.0
"""Largest distance of a point from a click, in pixels."""
Progress = Callable[[int, int], None]
Xyz = NDArray[np.float32]
"""A point in the LiDAR frame, in metres."""


class Answers:
    """Runs the method on the workspace, and keeps its answers.

    Attributes:
        stream: the recording of the tries.
    """

    def __init__(
        self,
        workspace: Workspace,
        stream: TryRecording,
        method: Calibrator,
        worker: Worker,
        tell_try: Callable[[Try], Awaitable[None]],
    ) -> None:
        """Start idle.

        Args:
            workspace: state of the session.
            stream: recording of the tries.
            method: method that answers.
            worker: worker that runs it.
            tell_try: called with every answer.
        """
        self._workspace, self.stream, self._method, self._worker = workspace, stream, method, worker
        self._tell_try = tell_try
        self._newest: tuple[int, Observation] | None = None
        self._unrecorded: set[int] = set()
        self._ready = False
        self.recorded: Callable[[], Awaitable[None]] = _nothing

    @property
    def stages(self) -> list[int]:
        """Numbers of the stages that can be run one at a time."""
        return list(self._method.numbers) if isinstance(self._method, StagedCalibrator) else []

    @property
    def solves_drives(self) -> bool:
        """Whether the method can solve all frames together."""
        return isinstance(self._method, DriveCalibrator)

    def get_ready(self) -> None:
        """Run the networks on the frame once in advance, since the first run on an image size takes twice as long."""
        method, frame, start = self._method, self._workspace.frame, self._workspace.extrinsic
        if self._ready or not isinstance(method, StagedCalibrator):
            return
        self._ready = True

        def compute(_: Progress) -> None:
            with contextlib.suppress(CalibrationError):  # a real request reports it
                method.calibrate(frame, start)

        async def finish(_: object) -> None:
            pass

        self._worker.ask_later(Job("getting ready", compute, finish))

    def run(self, number: int | None = None) -> None:
        """Run all stages, or the given one, from the pose.

        Raises:
            ConfigError: the method has no stages.
            CalibnetError: it has no such stage.
        """
        method = self._method
        if number is not None:
            if not isinstance(method, StagedCalibrator):
                raise ConfigError("This method has no stages that run one at a time; run all of it.")
            method = method.only(number)
        frame, start, reference = self._workspace.frame, self._workspace.extrinsic, self._workspace.reference

        def compute(_: Progress) -> tuple[CascadeTrace, float]:
            began = time.perf_counter()
            trace = method.calibrate(frame, start, detail=False)
            return trace, 1000 * (time.perf_counter() - began)

        async def finish(result: tuple[CascadeTrace, float]) -> None:
            trace, milliseconds = result
            made = self._workspace.keep(lambda number: Try.of_trace(number, frame.index, trace, milliseconds))
            self._record(made, method, frame, Observation(frame, trace, reference))
            await self._tell_try(made)

        self._worker.ask(Job("running all stages" if number is None else f"running stage {number}", compute, finish))

    def _record(self, made: Try, method: Calibrator, frame: Frame, answer: Observation) -> None:
        """Record a try once nobody waits for an answer, by running it again with all details."""
        seen: list[Observation] = []  # kept when the job has to make room

        def compute(tell: Progress) -> Observation:
            if not seen:
                self.stream.answer(made, answer)
                trace = detailed(method, frame, answer.trace, tell)
                seen.append(Observation(frame, trace, answer.reference))
            tell(1, 1)
            self.stream.log(made, seen[0])
            return seen[0]

        async def finish(observation: Observation) -> None:
            self._unrecorded.discard(made.number)
            if self._newest is None or made.number > self._newest[0]:  # the newest is recorded first
                self._newest = made.number, observation
            await self.recorded()

        self._unrecorded.add(made.number)
        self._worker.ask_later(Job(f"recording try {made.number}", compute, finish))

    def drive(self) -> None:
        """Solve all frames together, from the pose.

        Raises:
            ConfigError: the method cannot solve drives.
        """
        frames, start, index = self._workspace.frames, self._workspace.extrinsic, self._workspace.frame.index
        method = self._method
        if not isinstance(method, DriveCalibrator):
            raise ConfigError("This method calibrates single frames and cannot solve a drive; run a frame.")

        def compute(tell: Progress) -> tuple[DriveEstimate, float]:
            began = time.perf_counter()
            return method.calibrate_drive(frames, start, tell), 1000 * (time.perf_counter() - began)

        async def finish(result: tuple[DriveEstimate, float]) -> None:
            estimate, milliseconds = result
            made = self._workspace.keep(lambda number: Try.of_drive(number, index, start, estimate, milliseconds))
            await self._tell_try(made)

        self._worker.ask(Job("solving the drive", compute, finish))

    def worst(self, shown: Callable[[], Awaitable[None]]) -> None:
        """Show the frame, of some spread over the drive, with the worst result from this pose."""
        workspace, frames, pose = self._workspace, self._workspace.frames, self._workspace.pose

        def compute(tell: Progress) -> tuple[int, Frame]:
            positions, worst = evenly_spaced(len(frames), MOST_SEARCHED), (-math.inf, 0)
            for done, position in enumerate(positions):
                tell(done, len(positions))
                try:
                    frame = frames[position]
                    trace = self._method.calibrate(frame, pose.applied_to(workspace.guess_of(frame)), detail=False)
                    badness = _badness(trace, workspace.reference_of(frame))
                except (CalibrationError, DatasetError):
                    badness = math.inf
                worst = max(worst, (badness, position))
            return worst[1], frames[worst[1]]

        async def finish(found: tuple[int, Frame]) -> None:
            workspace.show(*found)
            await shown()

        self._worker.ask(Job("looking for the worst frame", compute, finish))

    def look(
        self, made: Try, under: Extrinsic, pixel: tuple[float, float], found: Callable[[Xyz], Awaitable[None]]
    ) -> None:
        """Move the search windows of the newest try to the point at a pixel of the image.

        Args:
            made: the newest try.
            under: ``camera_from_lidar`` that the image shows.
            pixel: ``(u, v)``.
            found: called with the point.

        Raises:
            ConfigError: the try is not the newest one of this frame or is still being recorded, or there is no point.
        """
        if made.number in self._unrecorded:
            raise ConfigError(f"Try {made.number} is still being recorded; click again in a moment.")
        number, observation = self._newest or (-1, None)
        if observation is None or number != made.number or observation.frame is not self._workspace.frame:
            raise ConfigError("Only the newest try on this frame still has its cost volumes; run again from there.")
        point = point_at(observation.projected(under), pixel, REACH_PX)
        if point is None:
            raise ConfigError("There is no point of the scan here; click on a point.")

        def compute(_: Progress) -> None:
            self.stream.log_point(made, observation, point)

        async def finish(_: object) -> None:
            await self.recorded()
            await found(observation.frame.points[point, :3])

        self._worker.ask(Job("looking there", compute, finish))


def detailed(method: Calibrator, frame: Frame, answer: CascadeTrace, tell: Progress) -> CascadeTrace:
    """An answer with all its details, computed again stage by stage, so that it can make room in between.

    Args:
        method: method that gave it.
        frame: frame of the answer.
        answer: answer without details.
        tell: called with (done, total) before each stage; may raise.
    """
    if not isinstance(method, StagedCalibrator):
        tell(0, 1)
        return method.calibrate(frame, answer.initial, detail=True)
    stages = list[StageTrace]()
    for done, stage in enumerate(answer.stages):
        tell(done, len(answer.stages) + 1)
        (seen,) = method.only(stage.number).calibrate(frame, stage.before, detail=True).stages
        stages.append(replace(stage, detail=seen.detail, camera=seen.camera, upright=seen.upright))
    return replace(answer, stages=tuple(stages))


def _badness(trace: CascadeTrace, reference: Extrinsic | None) -> float:
    """How bad a frame's result is: its error in degrees and decimetres or, without a reference, its match error."""
    if reference is None:
        return trace.stages[-1].match_error_px if trace.stages else 0.0
    error = pose_error(trace.arrived, reference)
    return error.rotation_deg + error.translation_cm / 10


async def _nothing() -> None:
    """Do nothing: no viewer is open."""
