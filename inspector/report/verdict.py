"""The verdict on a run and the meaning of its figures in words: a headline and a few findings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from calibnet.evaluation.metrics import Distribution, Metrics
from calibnet.geometry import PoseError, pose_error
from calibnet.geometry.types import Extrinsic
from calibnet.verdict import (
    ACCEPTED,
    CANNOT_TELL,
    DRIVE_TOLERANCES,
    FRAME_LIMITS,
    FRAME_TOLERANCES,
    REJECTED,
    Tolerance,
    Word,
)
from inspector.read.run import RecordedRun
from inspector.report.metrics import Figures, State
from inspector.verdicts import certainty, once

Grade = Literal["good", "fair", "bad", "note"]


class Finding(NamedTuple):
    """A sentence and its grade."""

    grade: Grade
    sentence: str


@dataclass(frozen=True)
class Quantity:
    """Rotation or translation.

    Attributes:
        name: name at the start of a sentence.
        unit: unit, including the space before it if there is one.
        axis: the unit as a word, for charts.
        decimals: number of meaningful decimals.
    """

    name: str
    unit: str
    axis: str
    decimals: int

    def say(self, value: float) -> str:
        """A value with its unit."""
        return f"{value:.{self.decimals}f}{self.unit}"

    def brief(self, value: float) -> str:
        """A value with its unit in two or three digits, for a sentence."""
        decimals = 2 if value < 1.0 else 1 if value < 10.0 else 0
        return f"{value:.{decimals}f}{self.unit}"

    def of(self, tolerance: Tolerance) -> float:
        """Its part of a tolerance."""
        return tolerance.rotation_deg if self.unit == "°" else tolerance.translation_cm

    def bound(self, value: float) -> str:
        """A limit with its unit, without empty decimals."""
        return f"{value:g}{self.unit}"


ROTATION = Quantity("Rotation", "°", "degrees", 2)
TRANSLATION = Quantity("Translation", "\u00a0cm", "centimetres", 1)
GRADES: dict[Word, Grade] = {ACCEPTED: "good", CANNOT_TELL: "fair", REJECTED: "bad"}
CLEAR_CHANGE = 2.0
"""Ratio of a correction to the frames' disagreement from which the correction is significant."""


def headline(figures: Figures) -> str:
    """The result in one sentence."""
    run = figures.run
    name = run.settings.get("sequence", run.title)
    if run.drive is not None and run.believes_drive and len(run.frames) > 1:
        return _drive_headline(figures, run.drive)
    if figures.has_reference:
        return (
            f"Corrected {count(len(run.frames))} of {name} from {pair(figures.initial.metrics)} to "
            f"{pair(figures.corrected.metrics)}{_median(figures)}."
        )
    result = f"Changed the calibration of {name} by {pair(figures.change)}{_median(figures)}"
    if len(run.frames) == 1:
        return f"{result}, judged from a single frame."
    return f"{result}; its {count(len(run.frames))} agree within {pair(figures.corrected.metrics)}."


def _drive_headline(figures: Figures, drive: Extrinsic) -> str:
    """A headline with the drive's extrinsic first, and then the single frames."""
    run, error = figures.run, figures.run.drive_error
    used = len(run.frames) - len({bad.frame for bad in run.verdict.skipped} & {frame.index for frame in run.frames})
    frames = count(used) if used == len(run.frames) else f"{used:,} of {count(len(run.frames))}"
    name = run.settings.get("sequence", run.title)
    if error is None:
        change = pose_error(drive, run.frames[0].initial)
        return f"Solved from {frames} as one, the calibration of {name} changed by {briefly(change)}."
    one_by_one = f"one by one {pair(figures.corrected.metrics)} in the median"
    return f"Corrected {name} from {pair(figures.initial.metrics)} to {briefly(error)}, {frames} as one; {one_by_one}."


def briefly(error: PoseError) -> str:
    """Both errors of one extrinsic, briefly."""
    return f"{ROTATION.brief(error.rotation_deg)}\u00a0/\u00a0{TRANSLATION.brief(error.translation_cm)}"


def verdict(run: RecordedRun) -> list[Finding]:
    """The reason of the run's verdict, likely causes, what to do next, the uncertainty, and the skipped frames."""
    found = run.verdict
    lines = [Finding(GRADES[found.word], found.reason)]
    lines += [Finding("bad", f"{one.name.capitalize()}: {once(one, found)}({one.evidence})") for one in found.causes]
    lines += [Finding("note", found.advice)] if found.advice else []
    lines += [Finding("note", certainty(found))] if certainty(found) else []
    return lines + [Finding("note", f"Frame {bad.frame} was skipped: {bad.why}") for bad in found.skipped]


def findings(figures: Figures) -> list[Finding]:
    """Findings on what is good in the figures and what is not."""
    if figures.rejected == len(figures.run.frames):
        return [Finding("bad", "Every frame is rejected: nothing was corrected.")]
    if figures.has_reference:
        errors = [_judge_error(quantity, figures) for quantity in (ROTATION, TRANSLATION)]
        return _rejected(figures) + errors + _together(figures)
    return _rejected(figures) + _judge_agreement(figures)


def pair(metrics: Metrics) -> str:
    """Both medians, briefly."""
    return (
        f"{ROTATION.brief(metrics.rotation_deg.median)}\u00a0/\u00a0{TRANSLATION.brief(metrics.translation_cm.median)}"
    )


def count(frames: int) -> str:
    """A number of frames in words."""
    return "1\u00a0frame" if frames == 1 else f"{frames:,}\u00a0frames"


def _median(figures: Figures) -> str:
    return " (median)" if len(figures.run.frames) > 1 else ""


def _leading(figures: Figures) -> PoseError | None:
    """Error of the drive's extrinsic, if the page leads with it."""
    run = figures.run
    return run.drive_error if run.believes_drive and len(run.frames) > 1 else None


def _statistics(quantity: Quantity, state: State) -> Distribution:
    return state.metrics.rotation_deg if quantity is ROTATION else state.metrics.translation_cm


def _judge_error(quantity: Quantity, figures: Figures) -> Finding:
    """A finding on the error of the drive's extrinsic or, without one, of the frames."""
    before, alone = (_statistics(quantity, state) for state in (figures.initial, figures.corrected))
    name, say, drive = quantity.name, quantity.say, _leading(figures)
    worse, spread, after, most = _worse(quantity, figures), "", alone.median, alone.p95
    if drive is not None:
        worse, after = "", drive.rotation_deg if quantity is ROTATION else drive.translation_cm
        most = after
    elif len(figures.run.frames) > 1:
        spread = f" (95 % of the frames below {say(most)})"
    if after >= before.median:
        return Finding("bad", f"{name} is not corrected: {say(before.median)} before, {say(after)} after.{worse}")
    result = f"{say(before.median)} before, {say(after)} after{spread}"
    good, fair = (quantity.of(one) for one in (FRAME_TOLERANCES if drive is None else DRIVE_TOLERANCES))
    limit = f"the limit is {quantity.bound(good)}"
    if most <= good:
        return Finding("good", f"{name} is good: {result}; {limit}.{worse}")
    if after <= good:
        return Finding("fair", f"{name} is good in most frames but not in all: {result}; {limit}.{worse}")
    if after <= fair:
        return Finding("fair", f"{name} is roughly right: {result}; {limit}.{worse}")
    return Finding("bad", f"{name} is not good enough: {result}; {limit}.{worse}")


def _worse(quantity: Quantity, figures: Figures, what: str = "it") -> str:
    """A sentence on the number of frames that got worse; empty for none, or for a single frame."""
    before, after = (
        state.rotation_deg if quantity is ROTATION else state.translation_cm
        for state in (figures.initial, figures.corrected)
    )
    worse, total = int(np.sum(after > before)), len(before)
    return f" In {worse} of {count(total)} {what} is worse than before." if worse and total > 1 else ""


def _rejected(figures: Figures) -> list[Finding]:
    """A finding on the rejected frames; none if there are none."""
    if not figures.rejected:
        return []
    were = "is rejected and was left as it was" if figures.rejected == 1 else "are rejected and were left as they were"
    return [Finding("bad", f"{figures.rejected} of {count(len(figures.run.frames))} {were}.")]


def _together(figures: Figures) -> list[Finding]:
    """A finding on the frames together or, if the page leads with the drive, on the single frames."""
    error, metrics = figures.median_error, figures.corrected.metrics
    if error is None or len(figures.run.frames) == 1:
        return []
    if _leading(figures) is not None:
        most = f"{ROTATION.say(metrics.rotation_deg.p95)} / {TRANSLATION.say(metrics.translation_cm.p95)}"
        worse = "".join(_worse(quantity, figures, quantity.name.lower()) for quantity in (ROTATION, TRANSLATION))
        return [Finding("note", f"One by one, 95 % of the frames end below {most}.{worse}")]
    off = f"{ROTATION.say(error.rotation_deg)} / {TRANSLATION.say(error.translation_cm)}"
    return [Finding("note", f"The median of all frames' results is off by {off}.")]


def _judge_agreement(figures: Figures) -> list[Finding]:
    run = figures.run
    unknown = Finding("note", "There is no reference, so errors are not known, only estimated.")
    if len(run.frames) == 1:
        return [unknown, Finding("bad", "A single frame cannot show agreement: run more frames.")]
    findings = [unknown]
    for quantity in (ROTATION, TRANSLATION):
        start, end = (_statistics(quantity, state) for state in (figures.initial, figures.corrected))
        name, scatter = quantity.name, f"{quantity.say(end.median)} in the median, {quantity.say(end.p95)} at 95 %"
        limit = quantity.of(FRAME_LIMITS)
        if end.p95 <= limit:
            findings.append(Finding("good", f"{name}: the frames agree well ({scatter})."))
        elif end.median <= limit:
            findings.append(Finding("fair", f"{name}: the frames agree roughly ({scatter})."))
        else:
            findings.append(Finding("bad", f"{name}: the frames do not agree ({scatter})."))
        if run.drive is None and start.median < CLEAR_CHANGE * end.median:
            offset = f"the start lies {quantity.say(start.median)} from the frames' median"
            doubt = "not clearly more than they disagree, so it may have been right"
            findings.append(Finding("note", f"{name}: {offset}, {doubt}."))
    shared = "Agreement cannot reveal an error that all frames share: look at the pictures."
    return [*findings, Finding("note", shared)]
