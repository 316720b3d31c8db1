"""What a recorded run has to stand: its verdict, and limits on its errors; as text and as JUnit XML."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from xml.etree import ElementTree

from calibnet.evaluation.metrics import Distribution, Metrics
from calibnet.runtime.text import one_line
from calibnet.verdict import ACCEPTED, CANNOT_TELL, REJECTED
from inspector.read.run import RecordedRun
from inspector.read.understood import RecordingError
from inspector.verdicts import explained

SUITE = "calib-inspect check"
STATISTICS = {"median": "median", "p95": "95th percentile", "max": "largest", "drive": "the drive's"}


@dataclass(frozen=True)
class Limit:
    """The largest value allowed of one kind of error.

    Attributes:
        kind: ``"rotation"`` or ``"translation"``.
        largest: in degrees or centimetres.
        statistic: one of `STATISTICS`, that must not exceed it: over the frames, or of the drive's one extrinsic.
    """

    kind: str
    largest: float
    statistic: str

    def say(self, value: float) -> str:
        """A value with its unit."""
        return f"{value:.4g}°" if self.kind == "rotation" else f"{value:.4g} cm"


@dataclass(frozen=True)
class Outcome:
    """A limit and what was found, in its unit."""

    limit: Limit
    value: float

    @property
    def passed(self) -> bool:
        """Whether the limit is kept; a value that is no number keeps none."""
        return self.value <= self.limit.largest

    @property
    def sentence(self) -> str:
        """What was found, and by how much it is too much."""
        limit = self.limit
        found = f"{STATISTICS[limit.statistic]} {limit.kind} error {limit.say(self.value)}"
        if self.passed:
            return f"{found} (allowed {limit.say(limit.largest)})"
        return f"{found} exceeds {limit.say(limit.largest)} by {limit.say(self.value - limit.largest)}"


def check_run(run: RecordedRun, limits: Sequence[Limit]) -> list[Outcome]:
    """Hold the corrected extrinsics of all frames against limits; none need no reference.

    Raises:
        RecordingError: the recording has no reference to measure errors against.
    """
    if not limits:
        return []
    if not run.has_reference:
        raise RecordingError(
            f"{run.path} has no reference extrinsic, so its errors are unknown; check it without limits, check a run "
            "on calibrated data, or give the folder command --range to take its calibration for the reference."
        )
    return [Outcome(limit, _value(run, limit)) for limit in limits]


def _value(run: RecordedRun, limit: Limit) -> float:
    """What is held against a limit."""
    if limit.statistic == "drive":
        of_drive = run.drive_error
        if of_drive is None:
            raise RecordingError(f"{run.path} has no estimate from the whole drive; record it with --drive.")
        return of_drive.rotation_deg if limit.kind == "rotation" else of_drive.translation_cm
    errors = [error for frame in run.frames if (error := frame.error(frame.corrected)) is not None]
    if limit.statistic == "max":
        return max(error.rotation_deg if limit.kind == "rotation" else error.translation_cm for error in errors)
    metrics = Metrics.of(errors)
    kinds: dict[str, Distribution] = {"rotation": metrics.rotation_deg, "translation": metrics.translation_cm}
    return float(getattr(kinds[limit.kind], limit.statistic))


def summary(run: RecordedRun, outcomes: Sequence[Outcome]) -> str:
    """The limits in one line; of a failure only what failed."""
    frames = "1 frame" if len(run.frames) == 1 else f"{len(run.frames)} frames"
    failed = [outcome.sentence for outcome in outcomes if not outcome.passed]
    if failed:
        return f"Failed: {'; '.join(failed)} ({run.path}, {frames})."
    return f"Passed: {'; '.join(outcome.sentence for outcome in outcomes)} ({run.path}, {frames})."


def junit(run: RecordedRun, outcomes: Sequence[Outcome]) -> bytes:
    """JUnit XML: a test case for the verdict, which is skipped where it cannot be told, and one a limit."""
    word = run.verdict.word
    counts = {
        "name": SUITE,
        "tests": str(1 + len(outcomes)),
        "failures": str((word == REJECTED) + sum(not outcome.passed for outcome in outcomes)),
        "errors": "0",
        "skipped": str(int(word == CANNOT_TELL)),
        "time": "0",
    }
    suites = ElementTree.Element("testsuites", counts)
    suite = ElementTree.SubElement(suites, "testsuite", counts)
    _add_verdict(suite, run)
    for outcome in outcomes:
        limit = outcome.limit
        name = f"{STATISTICS[limit.statistic]} {limit.kind} error is at most {limit.say(limit.largest)}"
        case = _case(suite, run, name)
        if outcome.passed:
            ElementTree.SubElement(case, "system-out").text = f"{run.title}: {outcome.sentence}"
        else:
            failure = {"type": "LimitExceeded", "message": outcome.sentence}
            ElementTree.SubElement(case, "failure", failure).text = f"{run.title}: {outcome.sentence}"
    for element in suites.iter():
        element.text = one_line(element.text) if element.text else None
        element.attrib.update({name: one_line(value) for name, value in element.attrib.items()})
    ElementTree.indent(suites)
    text: bytes = ElementTree.tostring(suites, encoding="utf-8", xml_declaration=True)
    return text + b"\n"


def _add_verdict(suite: ElementTree.Element, run: RecordedRun) -> None:
    case, reason = _case(suite, run, "verdict is accepted"), explained(run.verdict)
    if run.verdict.word == ACCEPTED:
        ElementTree.SubElement(case, "system-out").text = f"{run.title}: {reason}"
    elif run.verdict.word == REJECTED:
        ElementTree.SubElement(case, "failure", type="Rejected", message=reason).text = f"{run.title}: {reason}"
    else:
        ElementTree.SubElement(case, "skipped", message=f"Cannot tell: {reason}")


def _case(suite: ElementTree.Element, run: RecordedRun, name: str) -> ElementTree.Element:
    return ElementTree.SubElement(suite, "testcase", classname=f"calib-inspect.{run.path.stem}", name=name, time="0")
