"""What a page can ask for: each message is a dictionary with ``do``, and the answers go to all windows."""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import Awaitable, Callable
from typing import Any

import numpy as np

from calibnet.datasets.frame import Frame
from calibnet.datasets.selection import spread
from calibnet.errors import CalibnetError, CalibrationError, ConfigError, DatasetError
from calibnet.geometry import MiscalibrationRange, pose_error
from calibnet.geometry.types import Extrinsic
from calibnet.methods.calibrator import Calibrator, DriveCalibrator
from calibnet.trace import CascadeTrace
from inspector.live.accept import Target, doubts, verdict_on
from inspector.live.bench import Bench, StagedCalibrator
from inspector.live.payload import palettes
from inspector.live.pose import Pose
from inspector.live.stream import TryStream
from inspector.live.tries import Try
from inspector.live.worker import Job, Worker
from inspector.record.observation import Observation
from inspector.record.pictures.matches import point_at

MOST_SEARCHED = 24
"""Frames, spread over the drive, among which the worst is looked for."""
REACH_PX = 12.0
"""Distance from a click up to which a point counts."""
Tell = Callable[[dict[str, Any]], Awaitable[None]]


class LiveSession:
    """Acts on messages; everything but `Job.compute` runs in the server's thread.

    Attributes:
        bench: what is tried.
        stream: the recording of it.
    """

    def __init__(self, bench: Bench, method: Calibrator, target: Target, range_: MiscalibrationRange) -> None:
        """Begin without a try.

        Args:
            bench: with its first frame.
            method: that answers: the cascade, or another one.
            target: where an accepted calibration goes.
            range_: of the sliders, and of random poses.
        """
        self.bench, self.stream = bench, TryStream()
        self._method, self._target, self._range = method, target, range_
        self._worker = Worker(self._tell_state, self._tell_problem)
        self._observations: dict[int, Observation] = {}
        self.tell: Tell = _nobody
        self.grown: Callable[[], Awaitable[None]] = _nothing
        self._actions: dict[str, Callable[[dict[str, Any]], Awaitable[None]]] = {
            "pose": self._pose,
            "undo": self._undo,
            "redo": self._redo,
            "guess": self._to_guess,
            "reference": self._to_reference,
            "random": self._to_random,
            "take": self._take,
            "run": self._run,
            "drive": self._drive,
            "frame": self._frame,
            "worst": self._worst,
            "look": self._look,
            "accept": self._accept,
            "stop": self._stop,
        }

    async def act(self, message: dict[str, Any]) -> None:
        """Do what a message asks for; what cannot be done is told in a sentence."""
        try:
            action = self._actions.get(str(message.get("do")))
            if action is None:
                raise ConfigError(f"The page asks for {message.get('do')!r}, which there is not; reload it.")
            await action(message)
        except CalibnetError as error:
            await self._tell_problem(str(error))
        except (KeyError, TypeError, ValueError, IndexError):
            await self._tell_problem(f"The page sent {message!r}, which cannot be read; reload it.")

    def hello(self) -> dict[str, Any]:
        """What a window needs that opens."""
        return {
            "is": "hello",
            "name": self.bench.name,
            "stages": list(self._method.numbers) if isinstance(self._method, StagedCalibrator) else [],
            "range": [self._range.rotation_deg, self._range.translation_m],
            "target": str(self._target.file),
            "palettes": palettes(),
            "tries": [self._as_dict(made) for made in self.bench.tries],
            "state": self.state(),
        }

    def state(self) -> dict[str, Any]:
        """What changes with every message."""
        bench, camera = self.bench, self.bench.frame.camera
        reference = bench.reference
        return {
            "is": "state",
            "frame": {
                "index": bench.frame.index,
                "position": bench.position,
                "count": len(bench.frames),
                "size": [camera.width, camera.height],
                "camera": [*camera.focal, *camera.matrix[:2, 2].tolist()],
                "guess": bench.guess.ravel().tolist(),
                "reference": None if reference is None else reference.ravel().tolist(),
            },
            "pose": list(bench.pose),
            "can_undo": bench.can_undo,
            "can_redo": bench.can_redo,
            "busy": self._worker.busy,
            "progress": self._worker.progress,
        }

    async def idle(self) -> None:
        """Return when nothing runs or waits."""
        await self._worker.idle()

    def close(self) -> None:
        """End the running job and forget the recording."""
        self._worker.close()
        self.stream.close()

    # ---- the pose -----------------------------------------------------------------------------------------------

    async def _pose(self, message: dict[str, Any]) -> None:
        roll, pitch, yaw, x, y, z = map(float, message["pose"])
        pose = Pose(roll, pitch, yaw, x, y, z)
        if not pose.is_finite():
            raise ConfigError("Angles are within ±180° and offsets within ±100 m.")
        self.bench.move(pose)
        await self._moved(message)

    async def _undo(self, message: dict[str, Any]) -> None:
        self.bench.undo()
        await self._moved(message)

    async def _redo(self, message: dict[str, Any]) -> None:
        self.bench.redo()
        await self._moved(message)

    async def _to_guess(self, message: dict[str, Any]) -> None:
        self.bench.move(Pose())
        await self._moved(message)

    async def _to_reference(self, message: dict[str, Any]) -> None:
        if self.bench.reference is None:
            raise ConfigError("No reference is known for these frames.")
        self.bench.move_to(self.bench.reference)
        await self._moved(message)

    async def _to_random(self, message: dict[str, Any]) -> None:
        self.bench.move_randomly(MiscalibrationRange.parse(str(message.get("range") or self._range)))
        await self._moved(message)

    async def _take(self, message: dict[str, Any]) -> None:
        """Make a step of a try the pose; nothing runs from it by itself."""
        self.bench.move_to(self._step(message))
        await self._tell_state()

    def _step(self, message: dict[str, Any]) -> Extrinsic:
        return self.bench.tries[int(message["try"])].steps[int(message["step"])].camera_from_lidar

    async def _moved(self, message: dict[str, Any]) -> None:
        await self._tell_state()
        if message.get("run"):
            await self._run(message)

    # ---- running ------------------------------------------------------------------------------------------------

    async def _run(self, message: dict[str, Any]) -> None:
        """Run all stages, or the one that is named, from the pose."""
        number = message.get("stage")
        method = self._method
        if number is not None:
            if not isinstance(method, StagedCalibrator):
                raise ConfigError("This method has no stages to run one at a time.")
            method = method.only(int(number))
        frame, start, reference = self.bench.frame, self.bench.extrinsic, self.bench.reference

        def compute(_: Callable[[int, int], None]) -> tuple[CascadeTrace, float]:
            began = time.perf_counter()
            trace = method.calibrate(frame, start)
            return trace, 1000 * (time.perf_counter() - began)

        async def finish(result: tuple[CascadeTrace, float]) -> None:
            trace, milliseconds = result
            made = self.bench.keep(lambda number: Try.of_trace(number, frame.index, trace, milliseconds))
            await self._tell_try(made)
            self._record(made, method, frame, reference)

        self._worker.ask(Job("running all stages" if number is None else f"running stage {number}", compute, finish))

    def _record(self, made: Try, method: Calibrator, frame: Frame, reference: Extrinsic | None) -> None:
        """Record a try when nobody waits for an answer: only then is it run again with all its details."""

        def compute(_: Callable[[int, int], None]) -> Observation:
            trace = method.calibrate(frame, made.steps[0].camera_from_lidar, detail=True)
            observation = Observation(frame, trace, reference)
            self.stream.log(made, observation)
            return observation

        async def finish(observation: Observation) -> None:
            self._observations = {made.number: observation}
            await self.grown()

        self._worker.ask_later(Job(f"recording try {made.number}", compute, finish))

    async def _drive(self, message: dict[str, Any]) -> None:
        frames, start, index = self.bench.frames, self.bench.extrinsic, self.bench.frame.index
        method = self._method
        if not isinstance(method, DriveCalibrator):
            raise ConfigError("This method calibrates single frames and solves no drive.")

        def compute(tell: Callable[[int, int], None]) -> Any:
            began = time.perf_counter()
            return method.calibrate_drive(frames, start, tell), 1000 * (time.perf_counter() - began)

        async def finish(result: Any) -> None:
            estimate, milliseconds = result
            made = self.bench.keep(lambda number: Try.of_drive(number, index, start, estimate, milliseconds))
            await self._tell_try(made)

        self._worker.ask(Job("solving the drive", compute, finish))

    async def _stop(self, message: dict[str, Any]) -> None:
        self._worker.stop()

    # ---- frames -------------------------------------------------------------------------------------------------

    async def _frame(self, message: dict[str, Any]) -> None:
        position = int(message["position"]) % len(self.bench.frames)
        self.bench.show(position, await asyncio.to_thread(self.bench.frames.__getitem__, position))
        await self._moved(message)

    async def _worst(self, message: dict[str, Any]) -> None:
        """Show the frame, of some from all over the drive, that the cascade leaves worst from this pose."""
        frames, pose, start = self.bench.frames, self.bench.pose, self.bench

        def compute(tell: Callable[[int, int], None]) -> tuple[int, Frame]:
            positions, worst = spread(len(frames), MOST_SEARCHED), (-math.inf, 0)
            for done, position in enumerate(positions):
                tell(done, len(positions))
                try:
                    frame = frames[position]
                    trace = self._method.calibrate(frame, pose.applied_to(start.guess_of(frame)))
                    badness = _badness(trace, start.reference_of(frame))
                except (CalibrationError, DatasetError):
                    badness = math.inf
                worst = max(worst, (badness, position))
            return worst[1], frames[worst[1]]

        async def finish(found: tuple[int, Frame]) -> None:
            self.bench.show(*found)
            await self._moved({"run": True})

        self._worker.ask(Job("looking for the worst frame", compute, finish))

    async def _look(self, message: dict[str, Any]) -> None:
        """Move the search windows of the newest try to the point at a pixel of the picture under a step of it."""
        made = self.bench.tries[int(message["try"])]
        observation = self._observations.get(made.number)
        if observation is None or observation.frame is not self.bench.frame:
            raise ConfigError("Only the newest try on this frame still has its cost volumes; run again from there.")
        under = np.array(message["under"], float).reshape(4, 4) if "under" in message else self._step(message)
        point = point_at(
            observation.projected(under), (float(message["pixel"][0]), float(message["pixel"][1])), REACH_PX
        )
        if point is None:
            raise ConfigError("No point of the scan lies there; click on one.")

        def compute(_: Callable[[int, int], None]) -> None:
            self.stream.log_point(made, observation, point)

        async def finish(_: object) -> None:
            await self.grown()
            x, y, z = observation.frame.points[point, :3].tolist()
            distance = math.hypot(x, y, z)
            await self.tell({"is": "said", "text": f"Search windows moved to a point {distance:.1f} m away."})

        self._worker.ask(Job("looking there", compute, finish))

    # ---- keeping ------------------------------------------------------------------------------------------------

    async def _accept(self, message: dict[str, Any]) -> None:
        """Write an extrinsic as calibration; one that is not accepted only when that is confirmed."""
        by_hand = message.get("try") is None
        extrinsic = self.bench.extrinsic if by_hand else self._step(message)
        verdict = verdict_on(extrinsic, self.bench.tries)
        doubt = doubts(verdict)
        if doubt and not message.get("sure"):
            await self.tell(
                {"is": "sure?", "text": f"{doubt[0].upper()}{doubt[1:]}", "again": {**message, "sure": True}}
            )
            return
        origin = f"{self.bench.name}, frame {self.bench.frame.index}, accepted in calib-inspect live"
        text = self._target.write(self.bench.frame, np.array(extrinsic), origin, verdict)
        await self.tell({"is": "said", "text": text})

    # ---- telling ------------------------------------------------------------------------------------------------

    def _as_dict(self, made: Try) -> dict[str, Any]:
        return made.as_dict(self.bench.reference)

    async def _tell_try(self, made: Try) -> None:
        await self.tell({"is": "try", **self._as_dict(made)})

    async def _tell_state(self) -> None:
        await self.tell(self.state())

    async def _tell_problem(self, text: str) -> None:
        await self.tell({"is": "problem", "text": text})


def _badness(trace: CascadeTrace, reference: Extrinsic | None) -> float:
    """How wrong a frame ended: by its error in degrees and decimetres or, without a reference, by its fit."""
    if reference is None:
        return trace.stages[-1].match_error_px if trace.stages else 0.0
    error = pose_error(trace.arrived, reference)
    return error.rotation_deg + error.translation_cm / 10


async def _nobody(message: dict[str, Any]) -> None:
    """Tell nobody: no window is open."""


async def _nothing() -> None:
    """Do nothing: no viewer is open."""
