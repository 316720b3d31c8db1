"""``calib-inspect check``: its exit code, its one line and its JUnit XML."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from calibnet.geometry import miscalibration, pose_error
from calibnet.geometry.median import median_pose
from calibnet.verdict import Cause, Verdict
from inspector.check import Limit, Outcome, check_run
from inspector.cli.errors import run
from inspector.cli.main import cli
from inspector.read.run import read_run
from tests.support.fakes import FakeCascade
from tests.support.judged import REASON


@pytest.fixture(scope="module")
def own_drive(record: Callable[..., Any], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four frames without a reference, solved as a drive, of which one is rejected."""
    file = tmp_path_factory.mktemp("own") / "own.rrd"
    record(
        file, length=4, detail="overview", strides=(32,), as_is=True, drive=True, doubted=(1,), cascade_type=Scattered
    )
    return file


class Scattered(FakeCascade):
    """Leaves every frame elsewhere, and the last stages not sure of it."""

    def calibrate(self, frame: Any, initial: Any, detail: bool = True) -> Any:
        start = miscalibration([0.1 * frame.index, 0.0, 0.0], [0.02 * frame.index, 0.0, 0.0]) @ initial
        return replace(super().calibrate(frame, start, detail), initial=initial)


def call(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    code = run(cli, ["check", *map(str, arguments)])
    out, err = capsys.readouterr()
    return code, out, err


def test_the_statistic_is_taken_over_the_frames(full_recording: Path) -> None:
    recorded = read_run(full_recording)
    errors = [frame.error(frame.corrected) for frame in recorded.frames]
    rotation = np.array([error.rotation_deg for error in errors if error is not None])
    translation = np.array([error.translation_cm for error in errors if error is not None])
    outcomes = check_run(recorded, [Limit("rotation", 1.0, "p95"), Limit("translation", 1.0, "median")])
    assert [outcome.value for outcome in outcomes] == [np.percentile(rotation, 95), np.median(translation)]


def test_kept_limits_exit_0_and_the_verdict_is_last(full_recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = call(capsys, full_recording, "--max-rotation", 0.5, "--max-translation", 5)
    assert (code, err) == (0, "")
    assert out.startswith("Passed: median rotation error 0.15")
    expected = "Verdict: accepted. Of 3 frames 3 accepted, 0 rejected, 0 cannot tell."
    assert out.splitlines()[1:] == [expected]


def test_an_exceeded_limit_exits_1_and_says_by_how_much(
    full_recording: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, out, _ = call(capsys, full_recording, "--max-rotation", 0.05, "--max-translation", 5)
    assert code == 1
    assert out.startswith("Failed: median rotation error 0.155° exceeds 0.05° by 0.105°")
    assert "translation" not in out
    assert out.splitlines()[-1].startswith("Verdict: accepted.")


@pytest.mark.parametrize("value", [1.0, 1.0001, float("nan")])
def test_only_the_limit_and_below_pass(value: float) -> None:
    assert Outcome(Limit("rotation", 1.0, "median"), value).passed == (value == 1.0)


def test_junit_has_a_case_for_the_verdict_and_every_limit(
    full_recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "new" / "check.xml"
    bounds = ("--max-rotation", 0.5, "--max-translation", 0.1, "--statistic", "p95")
    assert call(capsys, full_recording, *bounds, "--junit", file)[0] == 1
    suites = ElementTree.parse(file).getroot()
    assert (suites.tag, suites.get("tests"), suites.get("failures")) == ("testsuites", "3", "1")
    verdict, passed, failed = suites.findall("testsuite/testcase")
    assert verdict.get("name") == "verdict is accepted" and verdict.find("failure") is None
    assert passed.get("name") == "95th percentile rotation error is at most 0.5°"
    assert passed.find("failure") is None
    failure = failed.find("failure")
    assert failure is not None
    assert "exceeds 0.1 cm by" in str(failure.get("message"))
    assert "fake/00" in str(failure.text)


@pytest.mark.parametrize(
    ("doubted", "unsure", "code", "said"),
    [
        ((), (), 0, "accepted. Of 3 frames 3 accepted, 0 rejected, 0 cannot tell."),
        ((1,), (), 0, f"accepted. Of 3 frames 2 accepted, 1 rejected (frame 1: {REASON[:-1]}), 0 cannot tell."),
        ((), (0, 2), 4, "cannot tell. Of 3 frames 1 accepted, 0 rejected, 2 cannot tell (frames 0, 2; frame 0: Image"),
        ((1, 2), (), 1, f"rejected. Of 3 frames 1 accepted, 2 rejected (frames 1, 2; frame 1: {REASON[:-1]}), "),
        ((1,), (0,), 4, "cannot tell. Of 3 frames 1 accepted, 1 rejected"),
    ],
)
def test_without_a_limit_the_verdict_decides(
    record: Callable[..., Any],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    doubted: tuple[int, ...],
    unsure: tuple[int, ...],
    code: int,
    said: str,
) -> None:
    record(tmp_path / "run.rrd", detail="overview", strides=(32,), doubted=doubted, unsure=unsure)
    report = tmp_path / "check.xml"
    found, out, _ = call(capsys, tmp_path / "run.rrd", "--junit", report)
    assert found == code and out.startswith(f"Verdict: {said}") and out.count("\n") == 1
    suites = ElementTree.parse(report).getroot()
    assert (suites.get("failures"), suites.get("skipped")) == (str(int(code == 1)), str(int(code == 4)))


def test_json_is_the_verdict_alone_on_stdout(
    record: Callable[..., Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, causes = tmp_path / "run.rrd", (Cause("mirrored", "The image looks mirrored.", "1.2 px, not 7.1 px"),)
    record(file, length=1, detail="overview", strides=(32,), doubted=(0,), causes=causes)
    code, out, err = call(capsys, file, "--json", "-")
    (frame,) = read_run(file).frames
    assert code == 1 and json.loads(out) == frame.verdict.as_dict() | {"limits": []}
    assert json.loads(out)["causes"] == [causes[0].as_dict()]
    assert err == f"Verdict: rejected. {REASON} The image looks mirrored.\n"


@pytest.mark.parametrize(
    ("option", "found"),
    [
        ("--max-scatter-rotation", "largest rotation between a frame and all frames' median {}°"),
        ("--max-scatter-translation", "largest distance between a frame and all frames' median {} cm"),
        ("--max-unused", "share of rejected and skipped frames {} %"),
        ("--max-fit", "largest error expected of the matches {} px"),
    ],
)
def test_limits_on_what_a_run_says_of_itself_need_no_reference(
    own_drive: Path, capsys: pytest.CaptureFixture[str], option: str, found: str
) -> None:
    recorded = read_run(own_drive)
    apart = [
        pose_error(frame.corrected, median_pose(recorded.results)) for frame in recorded.frames if not frame.rejected
    ]
    expected = {
        "--max-scatter-rotation": max(one.rotation_deg for one in apart),
        "--max-scatter-translation": max(one.translation_cm for one in apart),
        "--max-unused": 25.0,  # of four frames one is rejected
        "--max-fit": max(recorded.scalars("fit/stage_5")),
    }[option]
    assert expected > 0
    for share, passes in ((1.01, True), (0.99, False)):
        _, out, err = call(capsys, own_drive, "--statistic", "max", option, share * expected)
        assert err == "" and out.startswith("Passed: " if passes else "Failed: ")
        assert found.format(f"{expected:.4g}") in out


def test_the_stated_uncertainty_is_limited_as_it_is_stated(own_drive: Path, capsys: pytest.CaptureFixture[str]) -> None:
    recorded = read_run(own_drive)
    covariance = np.diag([0.04, 0.03, 0.0, 0.003, 0.0, 0.004]) ** 2
    sure = Verdict("accepted", "Fine.", recorded.frames[0].corrected, covariance=covariance)
    limits = [Limit("sigma_rotation", 0.3, "median"), Limit("sigma_translation", 4.9, "median")]
    rotation, translation = check_run(replace(recorded, drive_verdict=sure), limits)
    assert (rotation.value, translation.value) == pytest.approx((np.degrees(0.005), 5.0))
    assert rotation.passed and not translation.passed
    assert translation.sentence == "stated uncertainty of the translation, 1σ, 5 cm exceeds 4.9 cm by 0.1 cm"
    code, _, err = call(capsys, own_drive, "--max-sigma-rotation", 1)  # the fake drive states none
    assert code == 3 and "states no uncertainty" in err


def test_one_frame_does_not_scatter(
    record: Callable[..., Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    record(tmp_path / "own.rrd", length=1, detail="overview", as_is=True)
    code, _, err = call(capsys, tmp_path / "own.rrd", "--max-scatter-rotation", 1)
    assert code == 3 and "so there is no scatter" in err


def test_without_reference_it_is_one_sentence(
    record: Callable[..., Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    record(tmp_path / "own.rrd", length=1, detail="overview", as_is=True)
    code, out, err = call(capsys, tmp_path / "own.rrd", "--max-rotation", 1)
    assert (code, out) == (3, "")
    assert "has no reference extrinsic" in err
    assert err.count("\n") == 1


def test_json_says_of_every_limit_whether_it_is_kept(full_recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = call(capsys, full_recording, "--max-rotation", 0.01, "--max-translation", 50, "--json", "-")
    content = json.loads(out)
    assert code == 1 and content["verdict"] == "accepted"
    rotation, translation = content["limits"]
    assert rotation["name"] == "median rotation error" and rotation["largest"] == 0.01 < rotation["value"]
    assert (rotation["passed"], translation["passed"]) == (False, True)
