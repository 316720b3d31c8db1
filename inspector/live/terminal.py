"""A live session that is controlled by the keys of a terminal, beside Rerun's own window."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from typing import Any

from calibnet.geometry import degrees_and_cm
from inspector.live.keys import END, Read
from inspector.live.pose import Pose
from inspector.live.session import LiveSession
from inspector.live.window import WindowRecording
from inspector.markdown import markdown_table

AXIS_KEYS = {"qa": "roll", "ws": "pitch", "ed": "yaw", "rf": "x", "tg": "y", "yh": "z"}
"""Pairs of keys that increase and decrease a number of the pose, as in OpenCalib's manual tool."""
STEPS = {"coarse": (0.25, 0.02), "fine": (0.02, 0.002)}
"""Degrees and metres per key press; with Shift, a tenth of it."""
RELEASE_S = 0.3
"""Pause after the last key press after which the key counts as released, in seconds."""
POLL_S = 0.05
LEFT, RIGHT, ESCAPE = ("\x1b[D", "\x1bOD"), ("\x1b[C", "\x1bOC"), "\x1b"
MESSAGES: dict[str, dict[str, Any]] = {
    "\n": {"do": "run"},
    "\r": {"do": "run"},
    **{str(number): {"do": "run", "stage": number} for number in range(1, 6)},
    "m": {"do": "drive"},
    "x": {"do": "worst"},
    "z": {"do": "undo"},
    "Z": {"do": "redo"},
    "0": {"do": "guess"},
    "9": {"do": "reference"},
    "i": {"do": "random"},
}
HELP = {
    "q a, w s, e d": "roll, pitch, yaw",
    "r f, t g, y h": "x (right), y (down), z (ahead)",
    "Shift": "a tenth of the step",
    "v": "coarse or fine steps",
    "Enter": "run all stages",
    "1 to 5": "run only that stage",
    "m": "solve the drive from all frames",
    "z, Z": "undo, redo",
    "0, 9, i": "to guess, reference, random pose",
    "l": "set the pose to the last answer",
    "n, p, arrows": "next, previous frame",
    "x": "go to the worst frame",
    "k": "save the last answer as a calibration",
    "o": "run on release, or only on Enter",
    "?": "list these keys",
    "Esc, Ctrl-C": "end",
}


def help_text() -> str:
    """The list of keys, as Markdown."""
    return "\n".join(markdown_table(["key", "does"], HELP.items()))


class Terminal:
    """Turns keys into messages to a session, and its messages into lines."""

    def __init__(self, session: LiveSession, window: WindowRecording, say: Callable[[str], None]) -> None:
        """Connect a session with its window.

        Args:
            session: session that acts, and records to the window.
            window: window that follows the pose.
            say: function that prints a line.
        """
        self._session, self._window, self._say = session, window, say
        self._workspace = session.workspace
        self._steps, self._on_release = "coarse", True
        self._moved_at: float | None = None
        self._asked: dict[str, Any] | None = None
        self._busy = ""
        self._held: object = None
        session.tell = self._hear

    async def run(self, read: Read, stopped: Callable[[], bool] = lambda: False) -> None:
        """Act on keys until the end of input, the key that ends, or ``stopped``."""
        await self._hold()
        self._session.opened()
        while not stopped():
            for key in await asyncio.to_thread(read, POLL_S):
                if key in (END, ESCAPE):
                    await self._release()
                    await self._session.idle()
                    return
                await self._press(key)
            await self._hold()
            if self._moved_at is not None and time.monotonic() - self._moved_at >= RELEASE_S:
                await self._release()

    async def _press(self, key: str) -> None:
        if self._asked is not None:
            again, self._asked = self._asked, None
            if key == "y":
                await self._act(again)
            else:
                self._say("Nothing was written.")
        elif (pose := self._turned(key)) is not None:
            await self._session.act({"do": "pose", "pose": list(pose)})
            self._moved_at = time.monotonic()
        elif key in MESSAGES:
            self._moved_at = None
            moves = MESSAGES[key]["do"] in ("undo", "redo", "guess", "reference", "random")
            await self._session.act({**MESSAGES[key], **({"run": self._on_release} if moves else {})})
        elif key in (*LEFT, *RIGHT, "n", "p"):
            by = 1 if key in (*RIGHT, "n") else -1
            await self._session.act({"do": "frame", "position": self._workspace.position + by, "run": self._on_release})
        elif key in ("l", "k"):
            await self._last("take" if key == "l" else "accept")
        elif key == "v":
            self._steps = "fine" if self._steps == "coarse" else "coarse"
            degrees, metres = STEPS[self._steps]
            self._say(f"Step size: {degrees:g}° and {100 * metres:g} cm.")
        elif key == "o":
            self._on_release = not self._on_release
            self._say("Runs when keys are released." if self._on_release else "Runs on Enter only.")
        elif key == "?":
            for name, does in HELP.items():
                self._say(f"{name:>14}  {does}")

    def _turned(self, key: str) -> Pose | None:
        """The pose after a key that changes it; None for other keys."""
        for keys, axis in AXIS_KEYS.items():
            if key.lower() in (*keys,):
                step = STEPS[self._steps][axis in ("x", "y", "z")] * (0.1 if key.isupper() else 1.0)
                value = getattr(self._workspace.pose, axis) + (step if key.lower() == keys[0] else -step)
                return self._workspace.pose._replace(**{axis: value})
        return None

    async def _release(self) -> None:
        moved, self._moved_at = self._moved_at, None
        if moved is not None and self._on_release:
            await self._session.act({"do": "run"})

    async def _last(self, what: str) -> None:
        """Take or save the last answer; without one, the pose is saved."""
        if self._workspace.tries:
            made = self._workspace.tries[-1]
            await self._act({"do": what, "try": made.number, "step": len(made.steps) - 1})
        elif what == "accept":
            await self._act({"do": what})

    async def _act(self, message: dict[str, Any]) -> None:
        """Send a request, and ask the user to confirm if the session asks."""
        answer = await self._session.act(message)
        if answer is not None:
            await self._hear(answer)

    async def _hold(self) -> None:
        """Update the window if the pose or the frame has changed."""
        workspace = self._workspace
        now = (workspace.frame, workspace.pose)
        if self._held is None or now != self._held:
            self._held = now
            await asyncio.to_thread(
                self._window.hold, len(workspace.tries), workspace.frame, workspace.extrinsic, workspace.reference
            )

    async def _hear(self, message: dict[str, Any]) -> None:
        kind = message["is"]
        if kind == "try":
            for line in try_lines(message):
                self._say(line)
        elif kind in ("said", "problem"):
            self._say(message["text"])
        elif kind == "sure?":
            self._asked = message["again"]
            self._say(f"{message['text']} Write it anyway? y / n")
        elif kind == "state" and message["busy"] != self._busy:
            self._busy = message["busy"]
            if self._busy and not self._busy.startswith(("recording", "getting")):
                self._say(f"{self._busy[0].upper()}{self._busy[1:]} ...")


def try_lines(made: dict[str, Any]) -> list[str]:
    """The result of a try in lines, from `inspector.live.tries.Try.as_dict`."""
    verdict, sigma = made["verdict"], made["sigma"]
    word = "no verdict" if verdict is None else verdict["word"]
    told = word.upper() if verdict is None else f"{word.upper()} {verdict['within']}".rstrip()
    head = f"Try {made['number']}, frame {made['frame']}: {made['title']}, {made['milliseconds']} ms: {told}."
    reason = [] if verdict is None else [verdict["text"]]
    sure = [] if sigma is None else [f"±{degrees_and_cm(sigma[0], sigma[1])} (1σ)."]
    rows = []
    for position, step in enumerate(made["steps"]):
        name = f"after {step['name']}" if position else "start"
        error, moved = (
            None if one is None else f"{one[0]:.2f}°, {one[1]:.1f} cm" for one in (step["error"], step["moved"])
        )
        parts = [*([f"{error} off"] if error else []), *([f"moved by {moved}"] if position else [])]
        rows.append(f"  {name:<14} {'; '.join(parts)}")
    return [head, *rows, *[" ".join([*reason, *sure])]]
