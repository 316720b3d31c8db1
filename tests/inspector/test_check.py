"""``calib-inspect check``: its exit code, its one line and its JUnit XML."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from calibnet.verdict import Cause
from inspector.check import Limit, Outcome, check_run
from inspector.cli.errors import run
from inspector.cli.main import cli
from inspector.read.run import read_run
from tests.support.judged import REASON


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
        ((), (0, 2), 4, "cannot tell. Of 3 frames 1 accepted, 0 rejected, 2 cannot tell (frames 0, 2; frame 0: Pic"),
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
    file, causes = tmp_path / "run.rrd", (Cause("mirrored", "The picture looks mirrored.", "1.2 px, not 7.1 px"),)
    record(file, length=1, detail="overview", strides=(32,), doubted=(0,), causes=causes)
    code, out, err = call(capsys, file, "--json", "-")
    (frame,) = read_run(file).frames
    assert code == 1 and json.loads(out) == frame.verdict.as_dict()
    assert json.loads(out)["causes"] == [causes[0].as_dict()]
    assert err == f"Verdict: rejected. {REASON} The picture looks mirrored.\n"


def test_without_reference_it_is_one_sentence(
    record: Callable[..., Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    record(tmp_path / "own.rrd", length=1, detail="overview", as_is=True)
    code, out, err = call(capsys, tmp_path / "own.rrd", "--max-rotation", 1)
    assert (code, out) == (3, "")
    assert "has no reference extrinsic" in err
    assert err.count("\n") == 1
