"""A verdict in words: what it says, what to do next, and nothing twice."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

from calibnet.verdict import CANNOT_TELL, REJECTED, Cause, Verdict
from inspector.read.verdict import read_verdict
from inspector.report.verdict import verdict
from inspector.verdicts import explained, found_lines, markdown_lines, verdict_counts, verdict_line
from tests.support.fakes import REFERENCE

UNSURE = Verdict(CANNOT_TELL, "It is not certain.", REFERENCE, advice="Take more frames.")
INVERSE = Cause("axes", "The camera lies on its side; invert the extrinsic.", "the numbers in the input")


def test_the_last_line_ends_with_what_to_do_next() -> None:
    assert verdict_line(UNSURE) == "Verdict: cannot tell. It is not certain. Take more frames."
    assert explained(UNSURE) == "It is not certain.", "an exported file says no more"
    assert "Take more frames." in markdown_lines(UNSURE)
    assert markdown_lines(replace(UNSURE, advice="")) == ["# Cannot tell", "", "It is not certain.", ""]


def test_the_last_line_of_a_long_run_lists_some_frames() -> None:
    line = verdict_counts(dict.fromkeys(range(4541), UNSURE))
    assert line.endswith(
        "4541 cannot tell (frames 0, 1, 2, 3, 4, 5, 6, 7, 8, 9 and 4531 more; frame 0: It is not certain)."
    )


def test_a_cause_that_the_reason_ends_with_is_not_said_again() -> None:
    told = "Image and scan do not fit: the camera lies on its side; invert the extrinsic."
    ending = Verdict(REJECTED, told, REFERENCE, causes=(INVERSE,))
    assert explained(ending) == told and f"- **axes**: *({INVERSE.evidence})*" in markdown_lines(ending)
    assert [one.sentence for one in verdict(SimpleNamespace(verdict=ending))] == [told, f"Axes: ({INVERSE.evidence})"]
    other = Verdict(REJECTED, "Image and scan do not fit.", REFERENCE, causes=(INVERSE, INVERSE))
    assert verdict(SimpleNamespace(verdict=other))[1].sentence == f"Axes: {INVERSE.text} ({INVERSE.evidence})"
    assert explained(other) == f"Image and scan do not fit. {INVERSE.text}"
    assert f"- **axes**: *({INVERSE.evidence})*" in markdown_lines(
        Verdict(REJECTED, told, REFERENCE, causes=(INVERSE,))
    )


def test_below_the_verified_calibration_the_same_reason_is_not_said_again() -> None:
    given = Verdict(REJECTED, "Image and scan do not fit.", REFERENCE, causes=(INVERSE,))
    assert found_lines(given, given) == ["# Calibration found: rejected", "", "For the same reason.", ""]
    assert found_lines(UNSURE, given) == markdown_lines(UNSURE, "Calibration found")
    assert found_lines(UNSURE, None) == markdown_lines(UNSURE)


def test_a_recording_keeps_what_to_do_next_and_an_earlier_one_has_nothing() -> None:
    content = UNSURE.as_dict()
    assert read_verdict(json.dumps(content), Path("run.rrd")).advice == "Take more frames."
    del content["advice"]
    assert read_verdict(json.dumps(content), Path("run.rrd")).advice == ""
