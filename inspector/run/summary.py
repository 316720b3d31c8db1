"""The summary of a run on the terminal: errors before and after, times, and the verdict."""

from __future__ import annotations

import math
import time
from collections import defaultdict
from dataclasses import dataclass, field
from statistics import median

from calibnet.errors import CalibrationError, DatasetError
from calibnet.geometry import PoseError, degrees_and_cm, pose_error
from calibnet.geometry.types import Extrinsic
from calibnet.runtime.text import listed, number_of
from calibnet.verdict import REJECTED, BadFrame, Verdict
from inspector.record.observation import Observation
from inspector.verdicts import majority, verdict_counts, verdict_line

FAILURES_TOLD = 3
"""Number of frames of which the sentence that ends a run says why they cannot be used."""


@dataclass
class Summary:
    """Collects a few numbers per frame.

    Attributes:
        frames: number of recorded frames.
        verdicts: verdicts by frame number, of methods that give one.
        skipped: frames that could not be read or calibrated.
        unread: number of the skipped frames that could not be read.
        explained: number of frames in which causes were looked for.
        interrupted: whether the run ended before its last frame.
        started: start of the first frame, in seconds of the clock.
        ended: end of the last frame; None until then.
        drive: the result of the drive, in words.
        found: ``camera_from_lidar`` of the drive or of the only frame; None where it is not accepted.
        drive_verdict: verdict on the drive.
        given_verdict: verdict on the calibration that the run started from, where it was to be verified.
        method: name of the method; empty for the cascade.
    """

    frames: int = 0
    verdicts: dict[int, Verdict] = field(default_factory=dict, repr=False)
    skipped: list[BadFrame] = field(default_factory=list)
    unread: int = 0
    interrupted: bool = False
    explained: int = 0
    drive: str = ""
    found: Extrinsic | None = field(default=None, repr=False)
    drive_verdict: Verdict | None = field(default=None, repr=False)
    given_verdict: Verdict | None = field(default=None, repr=False)
    method: str = ""
    started: float = field(default_factory=time.monotonic)
    ended: float | None = None
    _numbers: list[int] = field(default_factory=list, repr=False)
    _bad: list[float] = field(default_factory=list, repr=False)
    _worse: list[int] = field(default_factory=list, repr=False)
    _initial: list[PoseError] = field(default_factory=list, repr=False)
    _corrected: list[PoseError] = field(default_factory=list, repr=False)
    _change: list[PoseError] = field(default_factory=list, repr=False)
    _milliseconds: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list), repr=False)

    def add(self, observation: Observation) -> None:
        """Add one frame."""
        trace = observation.trace
        self.frames += 1
        self.method = trace.method
        if trace.verdict is not None:
            self.verdicts[observation.frame.index] = trace.verdict
        self._numbers.append(observation.frame.index)
        self._bad.append(observation.badness)
        if observation.worse:
            self._worse.append(observation.frame.index)
        word = None if trace.verdict is None else trace.verdict.word
        self.found = trace.corrected if self.frames == 1 and word != REJECTED else None
        self._change.append(pose_error(trace.corrected, trace.initial))
        for errors, extrinsic in ((self._initial, trace.initial), (self._corrected, trace.corrected)):
            error = observation.error(extrinsic)
            if error is not None:
                errors.append(error)
        self._milliseconds["image and scan"].append(sum(trace.milliseconds.values()))
        for stage in trace.stages:
            self._milliseconds[f"stage {stage.number}"].append(sum(stage.milliseconds.values()))

    def frames_done(self) -> None:
        """Note that the single frames are done, so that what follows does not count towards their speed."""
        self.ended = time.monotonic()

    def check_enough(self) -> None:
        """Check that fewer than half of the frames were left out.

        Raises:
            DatasetError: half of them or more could not be used, and some could not be read.
            CalibrationError: half of them or more could be read but not calibrated.
        """
        bad, tried = self.skipped, self.frames + len(self.skipped)
        if bad and 2 * len(bad) >= tried:
            each = " ".join(f"Frame {one.frame}: {one.why}" for one in bad[:FAILURES_TOLD])
            kind = DatasetError if self.unread else CalibrationError
            raise kind(f"{len(bad)} of {tried} frames cannot be used, which is at least half. {each}")

    def lines(self) -> list[str]:
        """Sentences for the end of a run."""
        if self.frames == 0:
            return ["No frame was recorded."]
        seconds = (self.ended or time.monotonic()) - self.started
        lines = [f"{number_of(self.frames, 'frame')} in {seconds:.1f} s, {self.frames / seconds:.1f} frames/s."]
        lines += self.of_frames()
        if self.skipped:
            numbers = listed([bad.frame for bad in self.skipped])
            lines.append(f"{number_of(len(self.skipped), 'frame')} skipped because they could not be used: {numbers}.")
        if self.drive:
            lines.append(self.drive)
        times = ", ".join(f"{name} {median(values):.0f}" for name, values in self._milliseconds.items())
        lines.append(f"{self.method or 'Cascade'}, median milliseconds: {times}.")
        return lines

    def of_frames(self) -> list[str]:
        """Sentences on the single frames: their median, the worst, and how many got worse."""
        if not self._initial:
            lines = [f"Correction, median over frames: {_middle(self._change)}; there is no reference to compare with."]
            rejected = sum(verdict.word == REJECTED for verdict in self.verdicts.values())
            if rejected == self.frames:
                lines = ["By themselves all frames are rejected, and keep the extrinsic that they started from."]
            if len(self._bad) > 1 and math.isfinite(max(self._bad)):
                worst = self._bad.index(max(self._bad))
                lines.append(f"Worst fit: frame {self._numbers[worst]}, match error {self._bad[worst]:.1f} px.")
            return lines
        lines = [
            f"Error, median over frames: {_middle(self._initial)} initially, {_middle(self._corrected)} corrected."
        ]
        if len(self._corrected) > 1:
            worst = self._bad.index(max(self._bad))
            lines.append(f"Worst: frame {self._numbers[worst]}, with an error of {_figures(self._corrected[worst])}.")
        if self._worse:
            count, numbers = len(self._worse), ", ".join(map(str, self._worse))
            of_all = number_of(len(self._corrected), "frame")
            lines.append(f"{count} of {of_all} got worse in rotation or translation: {numbers}.")
        return lines

    def matrix_lines(self) -> list[str]:
        """The result, as the rows of a matrix."""
        if self.found is None:
            return []
        rows = [" ".join(f"{value:9.5f}" for value in row) for row in self.found[:3]]
        return [f"camera_from_lidar (metres), {'the whole drive as one' if self.drive else 'of this frame'}:", *rows]

    @property
    def outcome(self) -> Verdict | None:
        """The verdict on the given calibration, the drive or the only frame; None where each of several has its own."""
        single = next(iter(self.verdicts.values())) if len(self.verdicts) == 1 else None
        return self.given_verdict or self.drive_verdict or single

    @property
    def exportable(self) -> bool:
        """Whether the result may be exported, since it is not rejected."""
        if self.drive_verdict is not None:
            return self.drive_verdict.word != REJECTED
        return not self.verdicts or majority(self.verdicts.values()) != REJECTED

    @property
    def verdict(self) -> str:
        """The last line of a run: its verdict on the given calibration, the drive or the frames; empty without any."""
        if self.outcome is not None:
            return verdict_line(self.outcome)
        return verdict_counts(self.verdicts) if self.verdicts else ""


def _middle(errors: list[PoseError]) -> str:
    rotation = median(error.rotation_deg for error in errors)
    return degrees_and_cm(rotation, median(error.translation_cm for error in errors))


def _figures(error: PoseError) -> str:
    return degrees_and_cm(error.rotation_deg, error.translation_cm)
