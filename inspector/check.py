"""Bounds that a recorded run has to keep, and the verdict on each as text and as JUnit XML."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from xml.etree import ElementTree

from calibnet.evaluation.metrics import Distribution, Metrics
from inspector.read.file import RecordingError
from inspector.read.run import RecordedRun

SUITE = "calib-inspect check"
STATISTICS = {"median": "median", "p95": "95th percentile"}


@dataclass(frozen=True)
class Bound:
    """The largest value allowed of one kind of error.

    Attributes:
        kind: ``"rotation"`` or ``"translation"``.
        limit: in degrees or centimetres.
        statistic: over the frames, one of `STATISTICS`, that must not exceed it.
    """

    kind: str
    limit: float
    statistic: str

    def say(self, value: float) -> str:
        """A value with its unit."""
        return f"{value:.4g}°" if self.kind == "rotation" else f"{value:.4g} cm"


@dataclass(frozen=True)
class Verdict:
    """A bound and what was found, in its unit."""

    bound: Bound
    value: float

    @property
    def passed(self) -> bool:
        """Whether the bound is kept; a value that is no number keeps none."""
        return self.value <= self.bound.limit

    @property
    def sentence(self) -> str:
        """What was found, and by how much it is too much."""
        bound = self.bound
        found = f"{STATISTICS[bound.statistic]} {bound.kind} error {bound.say(self.value)}"
        if self.passed:
            return f"{found} (allowed {bound.say(bound.limit)})"
        return f"{found} exceeds {bound.say(bound.limit)} by {bound.say(self.value - bound.limit)}"


def check_run(run: RecordedRun, bounds: Sequence[Bound]) -> list[Verdict]:
    """Hold the corrected extrinsics of all frames against bounds.

    Raises:
        RecordingError: the recording has no reference to measure errors against.
    """
    if not run.has_reference:
        raise RecordingError(
            f"{run.path} has no reference extrinsic, so its errors are unknown; check a run on calibrated data, "
            "or give the folder command --range to take its calibration for the reference."
        )
    errors = [error for frame in run.frames if (error := frame.error(frame.corrected)) is not None]
    metrics = Metrics.of(errors)
    kinds: dict[str, Distribution] = {"rotation": metrics.rotation_deg, "translation": metrics.translation_cm}
    return [Verdict(bound, float(getattr(kinds[bound.kind], bound.statistic))) for bound in bounds]


def summary(run: RecordedRun, verdicts: Sequence[Verdict]) -> str:
    """The outcome in one line; of a failure only what failed."""
    frames = "1 frame" if len(run.frames) == 1 else f"{len(run.frames)} frames"
    failed = [verdict.sentence for verdict in verdicts if not verdict.passed]
    if failed:
        return f"Failed: {'; '.join(failed)} ({run.path}, {frames})."
    return f"Passed: {'; '.join(verdict.sentence for verdict in verdicts)} ({run.path}, {frames})."


def junit(run: RecordedRun, verdicts: Sequence[Verdict]) -> bytes:
    """The verdicts as JUnit XML, one test case a bound."""
    counts = {
        "name": SUITE,
        "tests": str(len(verdicts)),
        "failures": str(sum(not verdict.passed for verdict in verdicts)),
        "errors": "0",
        "skipped": "0",
        "time": "0",
    }
    suites = ElementTree.Element("testsuites", counts)
    suite = ElementTree.SubElement(suites, "testsuite", counts)
    for verdict in verdicts:
        bound = verdict.bound
        name = f"{STATISTICS[bound.statistic]} {bound.kind} error is at most {bound.say(bound.limit)}"
        attributes = {"classname": f"calib-inspect.{run.path.stem}", "name": name, "time": "0"}
        case = ElementTree.SubElement(suite, "testcase", attributes)
        if verdict.passed:
            ElementTree.SubElement(case, "system-out").text = f"{run.title}: {verdict.sentence}"
        else:
            failure = {"type": "BoundExceeded", "message": verdict.sentence}
            ElementTree.SubElement(case, "failure", failure).text = f"{run.title}: {verdict.sentence}"
    ElementTree.indent(suites)
    text: bytes = ElementTree.tostring(suites, encoding="utf-8", xml_declaration=True)
    return text + b"\n"
