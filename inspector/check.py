"""Checks of a recorded run: its verdict and limits on its figures, reported as text and as JUnit XML.

Limits on errors need a reference. Those on uncertainty, scatter between frames, unused frames and match error do not.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from xml.etree import ElementTree

import numpy as np

from calibnet.evaluation.metrics import Distribution, Metrics
from calibnet.geometry import pose_error
from calibnet.geometry.median import median_pose
from calibnet.runtime.text import one_line
from calibnet.verdict import ACCEPTED, CANNOT_TELL, REJECTED
from inspector.read.run import RecordedRun
from inspector.read.understood import RecordingError
from inspector.record.tabs.overview import fit_stage
from inspector.verdicts import with_advice

SUITE = "calib-inspect check"
STATISTICS = {"median": "median", "p95": "95th percentile", "max": "largest", "drive": "the drive's"}
KINDS = {
    "rotation": ("rotation error", "°"),
    "translation": ("translation error", " cm"),
    "sigma_rotation": ("stated uncertainty of the rotation, 1σ,", "°"),
    "sigma_translation": ("stated uncertainty of the translation, 1σ,", " cm"),
    "scatter_rotation": ("rotation between a frame and all frames' median", "°"),
    "scatter_translation": ("distance between a frame and all frames' median", " cm"),
    "unused": ("share of rejected and skipped frames", " %"),
    "fit": ("error expected of the matches", " px"),
}
"""Names of the limits, with their units."""
ERRORS, OF_THE_RUN = ("rotation", "translation"), ("sigma_rotation", "sigma_translation", "unused")
"""Kinds that need a reference, and kinds that are a single figure of a run rather than a statistic over frames."""


@dataclass(frozen=True)
class Limit:
    """Largest value allowed of a figure.

    Attributes:
        kind: one of `KINDS`.
        largest: the value, in the kind's unit.
        statistic: the one of `STATISTICS` that is limited, over the frames; ``"drive"`` means the error of the drive's
            extrinsic and, for kinds that are not errors, the median.
    """

    kind: str
    largest: float
    statistic: str

    @property
    def name(self) -> str:
        """The limited figure, in words."""
        if self.kind in OF_THE_RUN:
            return KINDS[self.kind][0]
        return f"{STATISTICS[self.statistic if self.kind in ERRORS else self.over_frames]} {KINDS[self.kind][0]}"

    @property
    def over_frames(self) -> str:
        """The statistic for kinds that are not errors."""
        return "median" if self.statistic == "drive" else self.statistic

    def say(self, value: float) -> str:
        """A value with its unit."""
        return f"{value:.4g}{KINDS[self.kind][1]}"


@dataclass(frozen=True)
class Outcome:
    """A limit and the value found, in its unit."""

    limit: Limit
    value: float

    @property
    def passed(self) -> bool:
        """Whether the value is within the limit; NaN never is."""
        return self.value <= self.limit.largest

    def as_dict(self) -> dict[str, object]:
        """The JSON object; values are in the unit of the name."""
        limit = self.limit
        value = self.value if math.isfinite(self.value) else None
        return {"name": limit.name, "value": value, "largest": limit.largest, "passed": self.passed}

    @property
    def sentence(self) -> str:
        """The value found, and by how much it exceeds the limit."""
        limit = self.limit
        found = f"{limit.name} {limit.say(self.value)}"
        if self.passed:
            return f"{found} (allowed {limit.say(limit.largest)})"
        return f"{found} exceeds {limit.say(limit.largest)} by {limit.say(self.value - limit.largest)}"


def check_run(run: RecordedRun, limits: Sequence[Limit]) -> list[Outcome]:
    """Check a run against limits.

    Raises:
        RecordingError: the recording lacks what one of them needs, such as a reference.
    """
    if not run.has_reference and any(limit.kind in ERRORS for limit in limits):
        raise RecordingError(
            f"{run.path} has no reference extrinsic, so its errors are unknown; use --max-sigma-rotation, "
            "--max-scatter-rotation, --max-unused or --max-fit instead, or record with --range, which takes the "
            "calibration of the data as the reference."
        )
    return [Outcome(limit, _value(run, limit)) for limit in limits]


def _value(run: RecordedRun, limit: Limit) -> float:
    """The value that a limit applies to."""
    if limit.kind in ERRORS:
        return _error(run, limit)
    if limit.kind.startswith("sigma"):
        verdict = run.verdict
        sigma = verdict.sigma_rotation_deg if limit.kind == "sigma_rotation" else verdict.sigma_translation_cm
        if sigma is None:
            raise RecordingError(f"{run.path} states no uncertainty; record a drive or a single frame.")
        return sigma
    if limit.kind == "unused":
        unused = sum(frame.rejected for frame in run.frames) + len(run.skipped)
        return 100 * unused / (len(run.frames) + len(run.skipped))
    values = _fits(run) if limit.kind == "fit" else _scatter(run, limit.kind)
    shares = {"median": 50.0, "p95": 95.0, "max": 100.0}
    return float(np.percentile(values, shares[limit.over_frames]))


def _scatter(run: RecordedRun, kind: str) -> list[float]:
    """Distance of every frame's result from the median of all, of frames that are not rejected."""
    if len(run.results) < 2:
        raise RecordingError(
            f"{run.path} has only one frame that is not rejected, so there is no scatter; record several frames."
        )
    middle = median_pose(run.results)
    apart = [pose_error(result, middle) for result in run.results]
    return [one.rotation_deg if kind == "scatter_rotation" else one.translation_cm for one in apart]


def _fits(run: RecordedRun) -> list[float]:
    """Match error that the last stage expects of every frame, in pixels of its image."""
    values = run.scalars(fit_stage(run.stages[-1].number))
    if not values:
        raise RecordingError(f"{run.path} has no curves of the match error; record them with --log curves.")
    return values


def _error(run: RecordedRun, limit: Limit) -> float:
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
    """All limits in one line; after a failure, only those that failed."""
    frames = "1 frame" if len(run.frames) == 1 else f"{len(run.frames)} frames"
    failed = [outcome.sentence for outcome in outcomes if not outcome.passed]
    if failed:
        return f"Failed: {'; '.join(failed)} ({run.path}, {frames})."
    return f"Passed: {'; '.join(outcome.sentence for outcome in outcomes)} ({run.path}, {frames})."


def junit(run: RecordedRun, outcomes: Sequence[Outcome]) -> bytes:
    """JUnit XML: a test case for the verdict, skipped where it is "cannot tell", and one per limit."""
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
        name = f"{limit.name} is at most {limit.say(limit.largest)}"
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
    case, reason = _case(suite, run, "verdict is accepted"), with_advice(run.verdict)
    if run.verdict.word == ACCEPTED:
        ElementTree.SubElement(case, "system-out").text = f"{run.title}: {reason}"
    elif run.verdict.word == REJECTED:
        ElementTree.SubElement(case, "failure", type="Rejected", message=reason).text = f"{run.title}: {reason}"
    else:
        ElementTree.SubElement(case, "skipped", message=f"Cannot tell: {reason}")


def _case(suite: ElementTree.Element, run: RecordedRun, name: str) -> ElementTree.Element:
    return ElementTree.SubElement(suite, "testcase", classname=f"calib-inspect.{run.path.stem}", name=name, time="0")
