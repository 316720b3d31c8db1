"""``calib-inspect verify``: the word, the sentence, JSON and exit code; and what is recorded only when asked for."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibnet.errors import CalibrationError, DatasetError
from calibnet.judging.advice import CORRECT_IT
from calibnet.trace import DriveEstimate, Estimate
from calibnet.verdict import Cause, Verdict
from inspector.cli.errors import run
from inspector.cli.main import cli
from inspector.read.run import read_run
from tests.support.fakes import REFERENCE, FakeCascade
from tests.support.folder import write_folder

COVARIANCE = np.diag([*[0.01**2] * 3, *[np.radians(0.05) ** 2] * 3])
"""1 cm and 0.05° on every axis."""
MIRRORED = Cause("mirrored", "The image looks mirrored.", "1.2 px, not 7.1 px")

Invoke = Callable[..., tuple[int, str, str]]


class Cascade(FakeCascade):
    """Finds the reference in every drive and frame, unless a test wants something else."""

    word = "accepted"
    causes: tuple[Cause, ...] = ()
    causes_of_frames: tuple[Cause, ...] = ()
    failure: Exception | None = None

    def calibrate(self, frame: Any, initial: Any, detail: bool = True) -> Any:
        trace = super().calibrate(frame, initial, detail)
        return replace(trace, verdict=self.verdict(1))

    def calibrate_drive(self, frames: Any, initial: Any, observer: Any = None) -> DriveEstimate:
        for position in range(len(frames)):
            try:
                _ = frames[position]
            except DatasetError:
                continue
        if self.failure is not None:
            raise self.failure
        history = ((0, Estimate(REFERENCE, COVARIANCE, len(frames))),)
        return DriveEstimate(REFERENCE, COVARIANCE, len(frames), history, verdict=self.verdict(len(frames)))

    def explain(self, frame: Any, initial: Any, lags: Any = None) -> Verdict:
        return replace(self.verdict(1), causes=self.causes_of_frames)

    def verdict(self, frames: int) -> Verdict:
        return Verdict(self.word, "Who knows.", REFERENCE, (0.0, 0.0), self.causes, COVARIANCE, frames)  # type: ignore[arg-type]


@pytest.fixture
def cascade(monkeypatch: pytest.MonkeyPatch) -> Cascade:
    from calibnet.cascade import cascade as module

    fake = Cascade()
    monkeypatch.setattr(module.Cascade, "load", staticmethod(lambda *_, **__: fake))
    return fake


@pytest.fixture
def invoke(
    cascade: Cascade, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> Invoke:
    monkeypatch.chdir(tmp_path)
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "KITTI_ROOT"):
        monkeypatch.delenv(name, raising=False)

    def call(*arguments: str) -> tuple[int, str, str]:
        code = run(cli, ["verify", *arguments])
        out, err = capsys.readouterr()
        return code, out, err

    return call


@pytest.fixture
def own_folder(tmp_path: Path) -> Path:
    """Three frames of the fake car, with the calibration that it has."""
    return write_folder(tmp_path / "own", 3)


def test_a_good_calibration_is_accepted_and_nothing_is_written(invoke: Invoke, own_folder: Path) -> None:
    code, out, _ = invoke("folder", str(own_folder))
    assert code == 0 and out.count("\n") == 1
    assert out.startswith("Verdict: accepted. The calibration is off by no more than 0.3° / 8 cm: 0.00° ± 0.10° ")
    assert {path.name for path in Path().iterdir()} == {"own"}


def test_a_disturbed_one_is_rejected_with_its_axis_in_words_and_json(invoke: Invoke, own_folder: Path) -> None:
    disturbed = ("--miscalibrate", "0,0,2,0,0,0.3", "--json", "-")
    code, out, err = invoke("folder", str(own_folder), *disturbed)
    content = json.loads(out)
    assert code == 1 and content["verdict"] == "rejected"
    assert "off by 2.00° ± 0.10° (most of it yaw, +2.00°) and " in content["reason"]
    assert err.splitlines()[-1] == f"Verdict: rejected. {content['reason']} {CORRECT_IT}"
    assert content["moved"]["rotation_deg"] == pytest.approx(2.0)
    assert content["sigma"]["covariance"] == COVARIANCE.tolist() and content["frames"] == {"used": 3, "skipped": []}
    np.testing.assert_allclose(content["camera_from_lidar"], REFERENCE)


def test_a_single_frame_is_held_against_wider_limits(invoke: Invoke, own_folder: Path) -> None:
    small = ("--miscalibrate", "0,0,0.6,0,0,0")
    assert invoke("folder", str(own_folder), *small)[0] == 1
    code, out, _ = invoke("folder", str(own_folder), *small, "--frames", "1")
    assert code == 0 and "no more than 1° / 25 cm: 0.60°" in out


@pytest.mark.parametrize(
    ("word", "causes", "code"),
    [("rejected", (), 4), ("cannot tell", (), 4), ("rejected", (MIRRORED,), 1)],
)
def test_what_the_drive_says_of_itself_decides(
    invoke: Invoke, own_folder: Path, cascade: Cascade, word: str, causes: tuple[Cause, ...], code: int
) -> None:
    cascade.word, cascade.causes = word, causes
    found, out, _ = invoke("folder", str(own_folder), "--json", "verdict.json")
    assert found == code and out.endswith("Who knows.\n" if not causes else f"Who knows. {MIRRORED.text}\n")
    content = json.loads(Path("verdict.json").read_text())
    assert [cause["name"] for cause in content["causes"]] == [cause.name for cause in causes]


@pytest.mark.parametrize("save", [(), ("--save", "why.rrd")])
def test_what_does_not_fit_is_a_verdict_with_json(
    invoke: Invoke, own_folder: Path, cascade: Cascade, save: tuple[str, ...]
) -> None:
    cascade.failure = CalibrationError("Image and scan do not fit together.")
    code, out, _ = invoke("folder", str(own_folder), "--json", "-", *save)
    assert (code, json.loads(out)["verdict"]) == (4, "cannot tell")
    cascade.causes_of_frames = (MIRRORED,)
    code, out, _ = invoke("folder", str(own_folder), "--json", "-", *save)
    content = json.loads(out)
    assert (code, content["verdict"], content["reason"]) == (1, "rejected", str(cascade.failure))
    assert content["causes"] == [MIRRORED.as_dict()]


@pytest.mark.parametrize("save", [(), ("--save", "why.rrd")])
@pytest.mark.parametrize("frames", [":", "1"])
def test_on_doubt_frames_are_asked_for_the_cause(
    invoke: Invoke, own_folder: Path, cascade: Cascade, frames: str, save: tuple[str, ...]
) -> None:
    cascade.causes_of_frames = (MIRRORED,)
    assert invoke("folder", str(own_folder), "--frames", frames, *save)[0] == 0  # accepted: nobody is asked
    cascade.word = "rejected"
    code, out, _ = invoke("folder", str(own_folder), "--frames", frames, *save)
    assert code == 1 and out.endswith(f"Verdict: rejected. Who knows. {MIRRORED.text}\n")


def test_what_is_refused_for_a_cause_is_a_verdict_too(
    invoke: Invoke, own_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from calibnet.datasets import paired

    error = DatasetError("The focal length is in millimetres.")
    error.cause = "focal-length"  # type: ignore[attr-defined]

    def read_frame(*_: object) -> None:
        raise error

    monkeypatch.setattr(paired.PairedSequence, "__getitem__", read_frame)
    code, out, _ = invoke("folder", str(own_folder), "--json", "-")
    content = json.loads(out)
    assert (code, content["verdict"]) == (1, "rejected")
    assert content["causes"][0]["name"] == "focal-length" and content["camera_from_lidar"] is None


def test_half_of_the_frames_unread_is_bad_input_and_less_is_not(invoke: Invoke, own_folder: Path) -> None:
    def cut(index: int) -> None:
        scan = own_folder / "clouds" / f"{index:04d}.bin"
        scan.write_bytes(scan.read_bytes()[:-7])

    cut(1)
    assert invoke("folder", str(own_folder))[0] == 0
    code, _, err = invoke("folder", str(own_folder), "--on-bad-frame", "stop")
    assert code == 3 and "0001.bin" in err
    cut(2)
    for save in ((), ("--save", "run.rrd")):
        code, out, err = invoke("folder", str(own_folder), *save)
        assert (code, out) == (3, "") and "2 of 3 frames cannot be" in err and "0002.bin" in err


def test_the_recording_shows_why_and_is_checked_like_it(invoke: Invoke, own_folder: Path, read: Any) -> None:
    disturbed = ("--miscalibrate", "0,0,2,0,0,0")
    code, out, _ = invoke("folder", str(own_folder), *disturbed, "--save", "why.rrd", "--detail", "overview")
    last = out.splitlines()[-1]
    assert code == 1 and last.startswith("Verdict: rejected. The calibration is off by 2.00° ± 0.10° (most of it yaw")
    recorded = read_run(Path("why.rrd"))
    assert recorded.given_verdict is not None and recorded.drive_verdict is not None
    assert (recorded.given_verdict.word, recorded.drive_verdict.word) == ("rejected", "accepted")
    assert recorded.verdict is recorded.given_verdict
    captions = [text.as_py()[0] for _, text in read(Path("why.rrd"), "overlay/drive/caption", "text")]
    assert captions and all(caption.startswith("calibration rejected, points as found: ") for caption in captions)
    assert run(cli, ["check", "why.rrd"]) == 1
    assert run(cli, ["export", "why.rrd", "--drive", "--format", "json"]) == 0  # what was found is good


def test_the_table_of_a_single_frame_begins_with_it(invoke: Invoke, own_folder: Path, read: Any) -> None:
    asked = ("--frames", "0", "--miscalibrate", "0,0,2,0,0,0", "--save", "one.rrd", "--detail", "overview")
    assert invoke("folder", str(own_folder), *asked)[0] == 1
    ((_, caption),) = read(Path("one.rrd"), "overlay/corrected/caption", "text")
    assert caption.as_py()[0].startswith("calibration rejected, points as found: ")
    ((_, text),) = read(Path("one.rrd"), "table", "TextDocument:text")
    assert text.as_py()[0].startswith("# Calibration as given: rejected\n\nThe calibration is off by 2.00°")


@pytest.mark.parametrize("save", [(), ("--save", "why.rrd")])
def test_frames_of_several_mounts_are_verified_one_at_a_time(
    invoke: Invoke, kitti_folder: Path, save: tuple[str, ...]
) -> None:
    root = str(kitti_folder / "object")
    code, _, err = invoke("object", "--root", root, *save)
    assert code == 2 and "several mounts" in err and "--frames 0" in err
    code, out, err = invoke("object", "--root", root, "--frames", "0", *save)
    assert code in (0, 1, 4), err
    assert out.splitlines()[-1].startswith("Verdict: ")


def test_verify_has_no_option_that_it_would_refuse_or_ignore(invoke: Invoke) -> None:
    shown = invoke("folder", "--help")[1]
    for option in ("--per-frame", "--method", "--drive", "--headless", "--intrinsics", "--masks"):
        assert option not in shown


def test_kitti_is_verified_as_it_is(invoke: Invoke, kitti_folder: Path) -> None:
    code, out, err = invoke("seq", "04", "--root", str(kitti_folder / "odometry"), "--frames", "0:2")
    assert code in (0, 1, 4) and out.startswith("Verdict: ")
    assert "from the calibration as it is" in err


def test_what_is_read_is_no_output_which_is_said_before_the_work(
    invoke: Invoke, own_folder: Path, cascade: Cascade
) -> None:
    cascade.failure = AssertionError("It began to work.")
    guess = Path("guess.json")
    guess.write_text(json.dumps({"camera_from_lidar": REFERENCE.tolist()}))
    before = guess.read_bytes()
    code, _, err = invoke("folder", str(own_folder), "--guess", "guess.json", "--json", "guess.json")
    assert code == 3 and "guess.json is an input of this run" in err
    assert guess.read_bytes() == before
