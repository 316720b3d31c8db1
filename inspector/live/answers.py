"""What takes long in a live session: running stages, solving the drive, looking for the worst frame, looking there.

Each is a job of the session's worker. An answer is told before anything is recorded of it: its details, which cost as
much again, are run stage by stage and recorded when nobody waits.
"""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Awaitable, Callable
from dataclasses import replace

import numpy as np

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
"""Frames, spread over the drive, among which the worst is looked for."""
REACH_PX = 12.0
"""Distance from a click up to which a point counts."""
Progress = Callable[[int, int], None]


class Answers:
    """Asks the method about what is on the workspace, and keeps what it says.

    Attributes:
        stream: the recording of it.
    """

    def __init__(
        self,
        workspace: Workspace,
        stream: TryRecording,
        method: Calibrator,
        worker: Worker,
        tell_try: Callable[[Try], Awaitable[None]],
    ) -> None:
        """Nothing runs yet.

        Args:
            workspace: what is tried.
            stream: where tries are recorded.
            method: that answers.
            worker: that runs it.
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
        """Those that can be run one at a time."""
        return list(self._method.numbers) if isinstance(self._method, StagedCalibrator) else []

    @property
    def solves_drives(self) -> bool:
        """Whether the method can solve all frames together."""
        return isinstance(self._method, DriveCalibrator)

    def get_ready(self) -> None:
        """Let the networks see the frame once, unasked: the first look at a size of picture takes twice as long."""
        method, frame, start = self._method, self._workspace.frame, self._workspace.extrinsic
        if self._ready or not isinstance(method, StagedCalibrator):
            return
        self._ready = True

        def compute(_: Progress) -> None:
            with contextlib.suppress(CalibrationError):  # whoever asks is told
                method.calibrate(frame, start)

        async def finish(_: object) -> None:
            pass

        self._worker.ask_later(Job("getting ready", compute, finish))

    def run(self, number: int | None = None) -> None:
        """Run all stages, or the one that is named, from the pose.

        Raises:
            ConfigError: the method has no stages.
            CalibnetError: it has no such stage.
        """
        method = self._method
        if number is not None:
            if not isinstance(method, StagedCalibrator):
                raise ConfigError("This method has no stages to run one at a time.")
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
        """Record a try when nobody waits for an answer: only then is it run again with all its details."""
        seen: list[Observation] = []  # what is there already when the job had to make room

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
            ConfigError: the method solves no drives.
        """
        frames, start, index = self._workspace.frames, self._workspace.extrinsic, self._workspace.frame.index
        method = self._method
        if not isinstance(method, DriveCalibrator):
            raise ConfigError("This method calibrates single frames and solves no drive.")

        def compute(tell: Progress) -> tuple[DriveEstimate, float]:
            began = time.perf_counter()
            return method.calibrate_drive(frames, start, tell), 1000 * (time.perf_counter() - began)

        async def finish(result: tuple[DriveEstimate, float]) -> None:
            estimate, milliseconds = result
            made = self._workspace.keep(lambda number: Try.of_drive(number, index, start, estimate, milliseconds))
            await self._tell_try(made)

        self._worker.ask(Job("solving the drive", compute, finish))

    def worst(self, shown: Callable[[], Awaitable[None]]) -> None:
        """Show the frame, of some from all over the drive, that the method leaves worst from this pose."""
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
        self, made: Try, under: Extrinsic, pixel: tuple[float, float], found: Callable[[float], Awaitable[None]]
    ) -> None:
        """Move the search windows of the newest try to the point at a pixel of the picture.

        Args:
            made: the newest try.
            under: ``camera_from_lidar`` that the picture shows.
            pixel: ``(u, v)``.
            found: told how many metres away the point is.

        Raises:
            ConfigError: it is not the newest one of this frame, is still being recorded, or no point lies there.
        """
        if made.number in self._unrecorded:
            raise ConfigError(f"Try {made.number} is still being recorded; click again in a moment.")
        number, observation = self._newest or (-1, None)
        if observation is None or number != made.number or observation.frame is not self._workspace.frame:
            raise ConfigError("Only the newest try on this frame still has its cost volumes; run again from there.")
        point = point_at(observation.projected(under), pixel, REACH_PX)
        if point is None:
            raise ConfigError("No point of the scan lies there; click on one.")

        def compute(_: Progress) -> None:
            self.stream.log_point(made, observation, point)

        async def finish(_: object) -> None:
            await self.recorded()
            await found(float(np.linalg.norm(observation.frame.points[point, :3])))

        self._worker.ask(Job("looking there", compute, finish))


def detailed(method: Calibrator, frame: Frame, answer: CascadeTrace, tell: Progress) -> CascadeTrace:
    """An answer with all its details, looked at again stage by stage: between two of them it can make room.

    Args:
        method: that gave it.
        frame: on this one.
        answer: without details.
        tell: called with (done, in all) before each stage; it may raise.
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
    """How wrong a frame ended: by its error in degrees and decimetres or, without a reference, by its fit."""
    if reference is None:
        return trace.stages[-1].match_error_px if trace.stages else 0.0
    error = pose_error(trace.arrived, reference)
    return error.rotation_deg + error.translation_cm / 10


async def _nothing() -> None:
    """Do nothing: no viewer is open."""
