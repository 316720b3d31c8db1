"""A session by keys, with Rerun's own window; the window is a file here."""

from __future__ import annotations

import asyncio
import io
import math
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rerun as rr
from PIL import Image

from calibnet.geometry import pose_error
from calibnet.verdict import Tolerance, Verdict
from inspector.live.keys import END, keyboard, split_keys
from inspector.live.session import LiveSession
from inspector.live.terminal import Terminal, help_text, try_lines
from inspector.live.tries import Step, Try
from inspector.live.window import WindowRecording
from inspector.live.workspace import Workspace
from tests.support.fakes import REFERENCE, FakeCascade

Read = Callable[..., list[tuple[Any, Any]]]


class Window:
    """A session whose window is a file, and the lines that it says."""

    def __init__(self, file: Path, make: Callable[..., LiveSession], **given: Any) -> None:
        self.file = file
        self.recording = WindowRecording(rr.FileSink(file), help_text())
        self.session = make(stream=self.recording, **given)
        self.said: list[str] = []

    @property
    def workspace(self) -> Workspace:
        return self.session.workspace

    def press(self, *keys: str) -> list[str]:
        """Press keys, each when what came before is done, then end; what was said."""
        self.said.clear()
        waiting = [*keys, END]

        async def all_of_it() -> None:
            terminal = Terminal(self.session, self.recording, self.said.append)

            def read(_: float) -> list[str]:
                return [waiting.pop(0)]

            original = terminal._press

            async def press(key: str) -> None:
                await original(key)
                await self.session.idle()

            terminal._press = press  # type: ignore[method-assign]
            await terminal.run(read)

        asyncio.run(all_of_it())
        return list(self.said)


@pytest.fixture
def window(make: Callable[..., LiveSession], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Window]:
    """Its keys are let go when they end, however long a busy machine takes between two of them."""
    monkeypatch.setattr("inspector.live.terminal.RELEASE_S", math.inf)
    return lambda **given: Window(tmp_path / "window.rrd", make, **given)


def test_keys_turn_and_move_and_letting_go_asks(window: Callable[..., Window]) -> None:
    one = window()
    said = one.press("q", "q", "A", "f", "y")
    assert tuple(one.workspace.pose) == pytest.approx((0.475, 0, 0, -0.02, 0, 0.02))
    (made,) = one.workspace.tries
    assert said[0] == "Running all stages ..."
    assert said[1].startswith("Try 0, frame 4: stages 3 to 5, ") and said[1].endswith(" ms: ACCEPTED.")
    error = pose_error(made.found, one.workspace.reference)
    assert any(f"{error.rotation_deg:.2f}°, {error.translation_cm:.1f} cm off" in line for line in said)
    said = one.press("v", "e", "z", "Z", "o", "d")
    assert one.workspace.pose.yaw == pytest.approx(0.0)
    assert "Step size: 0.02° and 0.2 cm." in said and "Runs on Enter only." in said


def test_single_stages_frames_and_the_drive(window: Callable[..., Window]) -> None:
    one = window()
    one.press("4", "n", "\x1b[D", "p", "m", "9")
    assert [made.title for made in one.workspace.tries][:1] == ["stage 4"]
    assert "drive of 3 frames" in [made.title for made in one.workspace.tries]
    assert one.workspace.frame.index == 6  # forth, back, and back round to the last of 4, 5, 6
    np.testing.assert_allclose(one.workspace.extrinsic, one.workspace.reference, atol=1e-9)
    assert "There is no stage" not in "".join(one.said)


def test_what_is_kept_is_asked_about_where_it_is_rejected(window: Callable[..., Window], tmp_path: Path) -> None:
    one, file = window(cascade=FakeCascade(doubted=(4,))), tmp_path / "out" / "calibration.corrected.yaml"
    said = one.press("\n", "k", "n")
    assert any(line.startswith("Rejected: ") and line.endswith("y / n") for line in said)
    assert said[-1] == "Nothing was written." and not file.exists()
    assert one.press("k", "y")[-1] == f"Wrote {file}."
    assert "rejected" in file.read_text()


def test_the_window_follows_the_hand_then_shows_the_stages_then_the_details(
    window: Callable[..., Window], read: Read
) -> None:
    one = window()
    one.press("q", "\n", "w", "\n")
    one.session.close()
    points = read(one.file, "overlay/current", "Points2D:positions", "try")
    assert sorted({step for step, _ in points}) == [
        8 * number + step for number in (0, 1) for step in (0, 3, 4, 5, 6, 7)
    ]
    mine = [value for step, value in points if step == 8]
    assert mine[0] != next(value for step, value in points if step == 0)
    for entity, component in (
        ("image", "EncodedImage:blob"),
        ("stage_5/scale_8/best_match", "EncodedImage:blob"),
        ("table", "TextDocument:text"),
    ):
        assert read(one.file, entity, component, "try"), entity
    words = [value.as_py()[0] for _, value in read(one.file, "table", "TextDocument:text", "try")]
    assert words[0].startswith("# No answer yet") and "Accepted" in words[-1]
    picture = read(one.file, "image", "EncodedImage:blob", "try")[0][1].as_py()[0]
    assert Image.open(io.BytesIO(bytes(picture))).size == (400, 120)


@pytest.mark.parametrize(
    ("sent", "keys"),
    [
        ("\x1b[15~", ["\x1b[15~"]),  # F5
        ("\x1b[1;2C", ["\x1b[1;2C"]),  # Shift and the right arrow
        ("\x1b[1;5Cq", ["\x1b[1;5C", "q"]),  # Ctrl and it
        ("\x1bOP", ["\x1bOP"]),  # F1
        ("\x1b[[A", ["\x1b[[A"]),  # F1 of Linux's console
        ("\x1bq", ["\x1bq"]),  # Alt and q
        ("\x1b", ["\x1b"]),
        ("\x1b\x1b", ["\x1b", "\x1b"]),
        ("q\x1b[Da\n", ["q", "\x1b[D", "a", "\n"]),
    ],
)
def test_what_a_terminal_sends_for_one_key_is_one_key(sent: str, keys: list[str]) -> None:
    assert split_keys(sent) == keys


def test_keys_that_mean_nothing_do_nothing(window: Callable[..., Window]) -> None:
    one = window()
    assert one.press("\x1b[15~", "\x1b[1;5C", "\x1bq", "\x1b[3~") == []
    assert one.workspace.position == 0 and not any(one.workspace.pose) and not one.workspace.tries


def test_keys_are_read_as_they_come() -> None:
    assert split_keys("qW\x1b[C\x1b") == ["q", "W", "\x1b[C", "\x1b"]
    out, into = os.pipe()
    with keyboard(out) as read:
        assert read(0.0) == []
        os.write(into, "qé\x1b[D".encode())
        assert read(5.0) == ["q", "é", "\x1b[D"]
        os.close(into)
        assert read(5.0) == [END]
    os.close(out)


def test_a_terminal_is_left_as_it_was_found() -> None:
    import pty
    import termios

    master, slave = pty.openpty()
    before = termios.tcgetattr(slave)
    with keyboard(slave) as read:
        assert not termios.tcgetattr(slave)[3] & termios.ICANON
        os.write(master, b"q")
        assert read(5.0) == ["q"]
    assert termios.tcgetattr(slave) == before


def test_every_key_that_is_told_does_something() -> None:
    assert all(f"| {key} |" in help_text() for key in ("q a, w s, e d", "Enter", "k"))


@pytest.mark.parametrize(
    ("within", "ends"), [(Tolerance(1.0, 25.0), " ms: CANNOT TELL within 1° / 25 cm."), (None, " ms: CANNOT TELL.")]
)
def test_a_try_says_within_what_its_result_is_certain_to_be(within: Tolerance | None, ends: str) -> None:
    verdict = Verdict("cannot tell", "", REFERENCE, (0.0, 0.0), within=within)
    made = Try(0, 4, "stages 3 to 5", (Step("start", REFERENCE),), verdict, 12)
    assert try_lines(made.as_dict(REFERENCE))[0].endswith(ends)
