"""``calib-inspect check``: its exit code, its one line and its JUnit XML."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from inspector.check import Bound, Verdict, check_run
from inspector.cli.errors import run
from inspector.cli.main import cli
from inspector.read.run import read_run


def call(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    code = run(cli, ["check", *map(str, arguments)])
    out, err = capsys.readouterr()
    return code, out, err


def test_the_statistic_is_taken_over_the_frames(full_recording: Path) -> None:
    recorded = read_run(full_recording)
    errors = [frame.error(frame.corrected) for frame in recorded.frames]
    rotation = np.array([error.rotation_deg for error in errors if error is not None])
    translation = np.array([error.translation_cm for error in errors if error is not None])
    verdicts = check_run(recorded, [Bound("rotation", 1.0, "p95"), Bound("translation", 1.0, "median")])
    assert [verdict.value for verdict in verdicts] == [np.percentile(rotation, 95), np.median(translation)]


def test_kept_bounds_exit_0_with_one_line(full_recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = call(capsys, full_recording, "--max-rotation", 0.5, "--max-translation", 5)
    assert (code, err) == (0, "")
    assert out.startswith("Passed: median rotation error 0.15")
    assert out.count("\n") == 1


def test_an_exceeded_bound_exits_1_and_says_by_how_much(
    full_recording: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, out, _ = call(capsys, full_recording, "--max-rotation", 0.05, "--max-translation", 5)
    assert code == 1
    assert out.startswith("Failed: median rotation error 0.155° exceeds 0.05° by 0.105°")
    assert "translation" not in out
    assert out.count("\n") == 1


@pytest.mark.parametrize("value", [1.0, 1.0001, float("nan")])
def test_only_the_bound_and_below_pass(value: float) -> None:
    assert Verdict(Bound("rotation", 1.0, "median"), value).passed == (value == 1.0)


def test_junit_has_a_case_a_bound_and_the_failure(
    full_recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "new" / "check.xml"
    bounds = ("--max-rotation", 0.5, "--max-translation", 0.1, "--statistic", "p95")
    assert call(capsys, full_recording, *bounds, "--junit", file)[0] == 1
    suites = ElementTree.parse(file).getroot()
    assert (suites.tag, suites.get("tests"), suites.get("failures")) == ("testsuites", "2", "1")
    passed, failed = suites.findall("testsuite/testcase")
    assert passed.get("name") == "95th percentile rotation error is at most 0.5°"
    assert passed.find("failure") is None
    failure = failed.find("failure")
    assert failure is not None
    assert "exceeds 0.1 cm by" in str(failure.get("message"))
    assert "fake/00" in str(failure.text)


def test_without_a_bound_it_is_wrong_usage(full_recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, _, err = call(capsys, full_recording)
    assert code == 2
    assert "--max-rotation" in err


def test_without_reference_it_is_one_sentence(
    record: Callable[..., Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    record(tmp_path / "own.rrd", length=1, detail="overview", as_is=True)
    code, out, err = call(capsys, tmp_path / "own.rrd", "--max-rotation", 1)
    assert (code, out) == (3, "")
    assert "has no reference extrinsic" in err
    assert err.count("\n") == 1
