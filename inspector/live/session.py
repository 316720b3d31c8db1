"""The requests of a page: each message is a dictionary with ``do``, and answers go to all windows."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

import numpy as np

from calibnet.calibrator import Calibrator
from calibnet.errors import CalibnetError, ConfigError
from calibnet.geometry import MiscalibrationRange
from calibnet.geometry.types import Extrinsic
from calibnet.runtime.reading import parse_json
from calibnet.runtime.text import one_line
from inspector.live.accept import Target, doubts, verdict_on
from inspector.live.answers import Answers, Xyz
from inspector.live.payload import palettes
from inspector.live.pose import Pose
from inspector.live.stream import TryRecording, TryStream
from inspector.live.tries import Try
from inspector.live.worker import Worker
from inspector.live.workspace import Workspace

MOST_QUOTED = 200
"""Characters of a message that are said again."""
Tell = Callable[[dict[str, Any]], Awaitable[None]]


class LiveSession:
    """Acts on messages; everything but `Job.compute` runs in the server's thread.

    Attributes:
        workspace: state of the session.
        stream: recording of the tries.
    """

    def __init__(
        self,
        workspace: Workspace,
        method: Calibrator,
        target: Target,
        range_: MiscalibrationRange,
        stream: TryRecording | None = None,
        known: str = "",
    ) -> None:
        """Start without a try.

        Args:
            workspace: state with the first frame.
            method: method that answers: the cascade, or another one.
            target: file for an accepted calibration.
            range_: range of the sliders and of random poses.
            stream: recording of the tries; None for a `TryStream`.
            known: what is known of the initial extrinsic, in words.
        """
        self.workspace, self.stream = workspace, stream or TryStream()
        self._target, self._range, self._known = target, range_, known
        self._worker = Worker(self._tell_state, self._tell_problem)
        self._answers = Answers(workspace, self.stream, method, self._worker, self._tell_try)
        self.tell: Tell = _nobody
        self._actions: dict[str, Callable[[dict[str, Any]], Awaitable[dict[str, Any] | None]]] = {
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

    async def hear(self, text: str | bytes) -> dict[str, Any] | None:
        """Do what a message in JSON asks for, see `act`; what is none is told in a sentence."""
        try:
            message = parse_json(text)
        except ValueError:
            message = None
        if isinstance(message, dict):
            return await self.act(message)
        await self._tell_unread(text)
        return None

    async def act(self, message: dict[str, Any]) -> dict[str, Any] | None:
        """Act on a message; failures are reported to the windows in a sentence.

        Returns:
            A question for whoever sent the message, and nobody else; None for most messages.
        """
        try:
            action = self._actions.get(str(message.get("do")))
            if action is None:
                raise ConfigError(f"Unknown request {one_line(repr(message.get('do')), MOST_QUOTED)}; reload the page.")
            return await action(message)
        except CalibnetError as error:
            await self._tell_problem(str(error))
        except OSError as error:
            await self._tell_problem(f"{error.filename or 'A file'}: {error.strerror or error}.")
        except (KeyError, TypeError, ValueError, IndexError, OverflowError):
            await self._tell_unread(message)
        return None

    def hello(self) -> dict[str, Any]:
        """The first message to a window."""
        return {
            "is": "hello",
            "name": self.workspace.name,
            "known": self._known,
            "stages": self._answers.stages,
            "drives": self._answers.solves_drives,
            "range": [self._range.rotation_deg, self._range.translation_m],
            "target": str(self._target.file),
            "palettes": palettes(),
            "tries": [self._as_dict(made) for made in self.workspace.tries],
            "state": self.state(),
        }

    def opened(self) -> None:
        """Get ready for the first request, since a window has opened."""
        self._answers.get_ready()

    def state(self) -> dict[str, Any]:
        """The state, which changes with every message."""
        workspace, camera = self.workspace, self.workspace.frame.camera
        reference = workspace.reference
        return {
            "is": "state",
            "frame": {
                "index": workspace.frame.index,
                "position": workspace.position,
                "count": len(workspace.frames),
                "size": [camera.width, camera.height],
                "camera": [*camera.focal, *camera.matrix[:2, 2].tolist()],
                "guess": workspace.guess.ravel().tolist(),
                "reference": None if reference is None else reference.ravel().tolist(),
            },
            "pose": list(workspace.pose),
            "can_undo": workspace.can_undo,
            "can_redo": workspace.can_redo,
            "busy": self._worker.busy,
            "progress": self._worker.progress,
        }

    def on_recorded(self, grown: Callable[[], Awaitable[None]]) -> None:
        """Set the function that is called when something was added to `stream`."""
        self._answers.recorded = grown

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
            raise ConfigError("Angles must be within ±180° and offsets within ±100 m.")
        self.workspace.move(pose)
        await self._moved(message)

    async def _undo(self, message: dict[str, Any]) -> None:
        self.workspace.undo()
        await self._moved(message)

    async def _redo(self, message: dict[str, Any]) -> None:
        self.workspace.redo()
        await self._moved(message)

    async def _to_guess(self, message: dict[str, Any]) -> None:
        self.workspace.move(Pose())
        await self._moved(message)

    async def _to_reference(self, message: dict[str, Any]) -> None:
        if self.workspace.reference is None:
            raise ConfigError("These frames have no reference.")
        self.workspace.move_to(self.workspace.reference)
        await self._moved(message)

    async def _to_random(self, message: dict[str, Any]) -> None:
        self.workspace.move_randomly(MiscalibrationRange.parse(str(message.get("range") or self._range)))
        await self._moved(message)

    async def _take(self, message: dict[str, Any]) -> None:
        """Set the pose to a step of a try, without running anything."""
        self.workspace.move_to(self._step(message))
        await self._tell_state()

    def _step(self, message: dict[str, Any]) -> Extrinsic:
        return self.workspace.tries[int(message["try"])].steps[int(message["step"])].camera_from_lidar

    async def _moved(self, message: dict[str, Any]) -> None:
        await self._tell_state()
        if message.get("run"):
            await self._run(message)

    # ---- running and frames -------------------------------------------------------------------------------------

    async def _run(self, message: dict[str, Any]) -> None:
        number = message.get("stage")
        self._answers.run(None if number is None else int(number))

    async def _drive(self, message: dict[str, Any]) -> None:
        self._answers.drive()

    async def _stop(self, message: dict[str, Any]) -> None:
        self._worker.stop()

    async def _frame(self, message: dict[str, Any]) -> None:
        position = int(message["position"]) % len(self.workspace.frames)
        self.workspace.show(position, await asyncio.to_thread(self.workspace.frames.__getitem__, position))
        await self._moved(message)

    async def _worst(self, message: dict[str, Any]) -> None:
        async def shown() -> None:
            await self._moved({"run": True})

        self._answers.worst(shown)

    async def _look(self, message: dict[str, Any]) -> None:
        """Move the search windows of the newest try to the point at a pixel of the image, under one of its steps."""
        under = np.array(message["under"], float).reshape(4, 4) if "under" in message else self._step(message)
        pixel, position = (float(message["pixel"][0]), float(message["pixel"][1])), self.workspace.position

        async def found(point: Xyz) -> None:
            text = f"Search windows moved to the ringed point, {np.linalg.norm(point):.1f} m away."
            await self.tell({"is": "said", "text": text, "ring": {"position": position, "point": point.tolist()}})

        self._answers.look(self.workspace.tries[int(message["try"])], under, pixel, found)

    # ---- keeping ------------------------------------------------------------------------------------------------

    async def _accept(self, message: dict[str, Any]) -> dict[str, Any] | None:
        """Write an extrinsic as a calibration; one that is not accepted needs a confirmation."""
        by_hand = message.get("try") is None
        extrinsic = self.workspace.extrinsic if by_hand else self._step(message)
        verdict = verdict_on(extrinsic, self.workspace.tries)
        doubt = doubts(verdict)
        if doubt and not message.get("sure"):
            return {"is": "sure?", "text": f"{doubt[0].upper()}{doubt[1:]}", "again": {**message, "sure": True}}
        origin = f"{self.workspace.name}, frame {self.workspace.frame.index}, accepted in calib-inspect live"
        text = self._target.write(self.workspace.frame, np.array(extrinsic), origin, verdict)
        await self.tell({"is": "said", "text": text})
        return None

    # ---- telling ------------------------------------------------------------------------------------------------

    def _as_dict(self, made: Try) -> dict[str, Any]:
        return made.as_dict(self.workspace.reference)

    async def _tell_try(self, made: Try) -> None:
        await self.tell({"is": "try", **self._as_dict(made)})

    async def _tell_state(self) -> None:
        await self.tell(self.state())

    async def _tell_unread(self, message: object) -> None:
        await self._tell_problem(f"Request {one_line(message, MOST_QUOTED)} is not valid; reload the page.")

    async def _tell_problem(self, text: str) -> None:
        await self.tell({"is": "problem", "text": text})


async def _nobody(message: dict[str, Any]) -> None:
    """Tell nobody: no window is open."""
