"""What a page can ask for, and what it is told."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibnet.datasets.folder import read_calibration_of
from calibnet.errors import CalibrationError
from calibnet.geometry import miscalibration
from inspector.live.accept import Target
from inspector.live.answers import detailed
from inspector.live.session import LiveSession
from inspector.live.worker import YieldedError
from tests.support.fakes import REFERENCE, FakeCascade, make_frame

Make = Callable[..., LiveSession]
HeardAfter = Callable[..., list[dict[str, Any]]]
MOVE = {"do": "pose", "pose": [0.5, 1.0, -1.0, 0.1, 0.0, -0.1], "run": True}


def told(heard: list[dict[str, Any]], kind: str) -> list[dict[str, Any]]:
    return [message for message in heard if message["is"] == kind]


def test_a_release_is_answered_stage_by_stage(make: Make, heard_after: HeardAfter) -> None:
    session = make()
    (answer,) = told(heard_after(session, MOVE), "try")
    assert [step["name"] for step in answer["steps"]] == ["mine", "stage 3", "stage 4", "stage 5"]
    np.testing.assert_allclose(np.reshape(answer["steps"][0]["extrinsic"], (4, 4)), session.workspace.extrinsic)
    errors = [step["error"][0] for step in answer["steps"]]
    assert errors == sorted(errors, reverse=True) and errors[-1] < 0.05 * errors[0]
    assert answer["verdict"]["word"] == "accepted"
    assert len(session.stream) == 1


def test_networks_see_the_frame_once_before_anybody_asks(make: Make) -> None:
    class Counting(FakeCascade):
        runs = 0

        def calibrate(self, frame: Any, initial: Any, detail: bool = True) -> Any:
            self.runs += 1
            if self.runs == 1:
                raise CalibrationError("Only 3 cells hold a point.")
            return super().calibrate(frame, initial, detail)

    cascade, problems = Counting(), []
    session = make(cascade=cascade)

    async def look() -> None:
        async def hear(message: dict[str, Any]) -> None:
            problems.extend([message] if message["is"] == "problem" else [])

        session.tell = hear
        for _ in range(2):
            session.opened()
            await session.idle()

    asyncio.run(look())
    assert (cascade.runs, problems, session.workspace.tries) == (1, [], [])


def test_without_run_the_pose_alone_moves(make: Make, heard_after: HeardAfter) -> None:
    session = make()
    heard = heard_after(session, {**MOVE, "run": False}, {"do": "undo"}, {"do": "redo"}, {"do": "guess"})
    assert told(heard, "try") == []
    poses = [state["pose"] for state in told(heard, "state")]
    assert poses == [MOVE["pose"], [0.0] * 6, MOVE["pose"], [0.0] * 6]


def test_a_window_is_told_what_is_known_of_the_pose(make: Make) -> None:
    assert make(known="x, y, z fixed").hello()["known"] == "x, y, z fixed"
    assert make().hello()["known"] == ""


def test_one_stage_alone(make: Make, heard_after: HeardAfter) -> None:
    (answer,) = told(heard_after(make(), {"do": "run", "stage": 4}), "try")
    assert [step["name"] for step in answer["steps"]] == ["mine", "stage 4"]


def test_the_drive_is_solved_and_tells_how_far_it_is(make: Make, heard_after: HeardAfter) -> None:
    (answer,) = told(heard_after(make(), {"do": "drive"}), "try")
    assert answer["title"] == "drive of 3 frames"
    assert answer["steps"][-1]["error"] == pytest.approx([0.1, 0.05], abs=0.01)


def test_a_taken_step_becomes_the_pose(make: Make, heard_after: HeardAfter) -> None:
    session = make()
    heard_after(session, MOVE, {"do": "take", "try": 0, "step": 3})
    np.testing.assert_allclose(session.workspace.extrinsic, session.workspace.tries[0].found, atol=1e-12)
    assert session.workspace.can_undo


def test_frames_go_round_and_the_worst_is_found(make: Make, heard_after: HeardAfter) -> None:
    class Uneven(FakeCascade):
        def calibrate(self, frame: Any, initial: Any, detail: bool = True) -> Any:
            trace = super().calibrate(frame, initial, detail)
            return super().calibrate(frame, trace.arrived, detail) if frame.index != 5 else trace

    session = make(cascade=Uneven())
    heard_after(session, {"do": "frame", "position": -1})
    assert session.workspace.frame.index == 6
    (answer,) = told(heard_after(session, {"do": "worst"}), "try")
    assert session.workspace.frame.index == 5 and answer["frame"] == 5


def test_a_click_moves_the_windows_to_that_point(make: Make, heard_after: HeardAfter) -> None:
    session = make()
    heard_after(session, MOVE)
    seen = session._answers._newest[1].projected(session.workspace.tries[0].found)
    nearest = int(np.argmin(seen.depth))
    pixel = seen.pixels[nearest].tolist()
    heard = heard_after(session, {"do": "look", "try": 0, "step": 3, "pixel": pixel})
    distance = float(np.linalg.norm(make_frame(4).points[seen.index[nearest], :3]))
    (said,) = told(heard, "said")
    assert said["text"] == f"Search windows moved to the ringed point, {distance:.1f} m away."
    assert said["ring"] == {"position": 0, "point": make_frame(4).points[seen.index[nearest], :3].tolist()}
    assert len(session.stream) == 2
    heard = heard_after(session, {"do": "look", "try": 0, "step": 3, "pixel": [-500, -500]})
    assert "There is no point of the scan here" in told(heard, "problem")[0]["text"]
    heard = heard_after(session, {"do": "frame", "position": 1}, {"do": "look", "try": 0, "step": 3, "pixel": pixel})
    assert "Only the newest try on this frame" in told(heard, "problem")[0]["text"]


def test_what_is_accepted_is_written_as_a_calibration(make: Make, heard_after: HeardAfter, tmp_path: Path) -> None:
    session = make()
    heard = heard_after(session, MOVE, {"do": "accept", "try": 0, "step": 3})
    file = tmp_path / "out" / "calibration.corrected.yaml"
    assert told(heard, "said")[0]["text"] == f"Wrote {file}."
    path, camera, written = read_calibration_of(file.parent)
    assert path == file and camera.width == session.workspace.frame.camera.width
    np.testing.assert_allclose(written, session.workspace.tries[0].found, atol=1e-12)
    assert told(heard_after(session, {"do": "accept", "try": 0, "step": 3}), "said")[0]["text"].startswith("Replaced")


@pytest.mark.parametrize(("form", "name"), [("koide3", "calib.json"), ("json", "calib.json"), ("urdf", "calib.urdf")])
def test_what_is_accepted_again_replaces_what_was(
    make: Make, heard_after: HeardAfter, tmp_path: Path, form: str, name: str
) -> None:
    session = make(target=Target(tmp_path / name, form))
    for word in ("Wrote", "Replaced"):
        heard = heard_after(session, MOVE, {"do": "accept", "try": 0, "step": 3})
        assert told(heard, "said")[0]["text"].startswith(word)
    Target(tmp_path / name, form).check()  # so does the next session


def test_a_click_on_a_try_that_is_not_recorded_yet_says_so(make: Make) -> None:
    session, heard = make(), []

    async def say() -> None:
        async def hear(message: dict[str, Any]) -> None:
            heard.append(message)
            if message["is"] == "try":
                await session.act({"do": "look", "try": 0, "step": 3, "pixel": [0, 0]})

        session.tell = hear
        await session.act(MOVE)
        await session.idle()

    asyncio.run(say())
    assert [one["text"] for one in told(heard, "problem")] == [
        "Try 0 is still being recorded; click again in a moment."
    ]


@pytest.mark.parametrize(
    ("cascade", "message", "words"),
    [
        (FakeCascade(doubted=(4,)), {"try": 0, "step": 3}, "Rejected: "),
        (FakeCascade(unsure=(4,)), {"try": 0, "step": 3}, "Cannot tell: "),
        (FakeCascade(), {"try": 0, "step": 2}, "Set by hand, without a verdict"),
        (FakeCascade(), {}, "Set by hand, without a verdict"),
    ],
)
def test_what_is_not_accepted_is_asked_about_first(
    make: Make, heard_after: HeardAfter, tmp_path: Path, cascade: Any, message: dict[str, Any], words: str
) -> None:
    session = make(cascade=cascade)
    (asked,) = told(heard_after(session, MOVE, {"do": "accept", **message}), "sure?")
    assert asked["text"].startswith(words)
    file = tmp_path / "out" / "calibration.corrected.yaml"
    assert not file.exists()
    heard_after(session, asked["again"])
    assert words.rstrip(": ").lower() in file.read_text().lower()


def test_another_file_is_not_replaced(make: Make, heard_after: HeardAfter, tmp_path: Path) -> None:
    session = make()
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "calibration.corrected.yaml").write_text("mine: 1\n")
    heard = heard_after(session, MOVE, {"do": "accept", "try": 0, "step": 3})
    assert "add --overwrite" in told(heard, "problem")[0]["text"]
    assert (tmp_path / "out" / "calibration.corrected.yaml").read_text() == "mine: 1\n"


@pytest.mark.parametrize(
    ("message", "words"),
    [
        ({"do": "fly"}, "Unknown request 'fly'; reload the page"),
        ({}, "Unknown request None"),
        ({"do": "pose", "pose": [0, 0, 0]}, "is not valid"),
        ({"do": "pose", "pose": "abcdef"}, "is not valid"),
        ({"do": "pose", "pose": [float("nan")] * 6}, "within ±180°"),
        ({"do": "take", "try": 7, "step": 0}, "is not valid"),
        ({"do": "look", "try": 0, "pixel": None}, "is not valid"),
        ({"do": "random", "range": "much"}, "not of the form"),
        ({"do": "run", "stage": 9}, "stage"),
    ],
)
def test_what_cannot_be_done_is_said(make: Make, heard_after: HeardAfter, message: Any, words: str) -> None:
    class Strict(FakeCascade):
        def only(self, number: int) -> FakeCascade:
            if number not in self.numbers:
                raise CalibrationError(f"There is no stage {number}.")
            return super().only(number)

    session = make(cascade=Strict())
    (problem,) = told(heard_after(session, message), "problem")
    assert words in problem["text"]


def test_a_frame_that_cannot_be_calibrated_is_a_sentence_and_the_session_goes_on(
    make: Make, heard_after: HeardAfter
) -> None:
    class Fails(FakeCascade):
        fails = True

        def calibrate(self, frame: Any, initial: Any, detail: bool = True) -> Any:
            if self.fails:
                raise CalibrationError("Only 3 cells hold a point.")
            return super().calibrate(frame, initial, detail)

    cascade = Fails()
    session = make(cascade=cascade)
    assert told(heard_after(session, MOVE), "problem")[0]["text"] == "Only 3 cells hold a point."
    cascade.fails = False
    assert len(told(heard_after(session, {"do": "run"}), "try")) == 1


def test_without_reference_there_are_no_errors(make: Make, heard_after: HeardAfter) -> None:
    session = make(as_is=True)
    heard = heard_after(session, MOVE, {"do": "reference"})
    assert all(step["error"] is None for step in told(heard, "try")[0]["steps"])
    assert told(heard, "problem")[0]["text"] == "These frames have no reference."
    np.testing.assert_allclose(session.workspace.guess, REFERENCE)


def test_details_are_those_of_a_whole_run_and_make_room_between_two_stages() -> None:
    cascade, frame = FakeCascade(), make_frame(0)
    initial = miscalibration([1, 0, 2], [0.1, 0, 0]) @ frame.camera_from_lidar
    answer, whole = (cascade.calibrate(frame, initial, detail=detail) for detail in (False, True))
    told = list[tuple[int, int]]()
    found = detailed(cascade, frame, answer, lambda done, total: told.append((done, total)))
    assert told == [(0, 4), (1, 4), (2, 4)]
    assert found.verdict is answer.verdict
    for mine, other in zip(found.stages, whole.stages, strict=True):
        assert mine.detail is not None and other.detail is not None
        np.testing.assert_array_equal(mine.detail.displacement, other.detail.displacement)
        np.testing.assert_array_equal(mine.after, other.after)

    def yields(done: int, _: int) -> None:
        if done:
            raise YieldedError

    with pytest.raises(YieldedError):
        detailed(cascade, frame, answer, yields)
