"""Measures whether verdicts are right: faults are put into frames, and verdicts compared with the true error."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from calibnet.calibrator import Calibrator
from calibnet.cascade import Cascade
from calibnet.datasets.frame import Frame
from calibnet.datasets.frame import Sequence as FrameSequence
from calibnet.datasets.selection import evenly_spaced
from calibnet.errors import CalibrationError
from calibnet.evaluation.audit import other_drive
from calibnet.evaluation.corruptions import Corruption, corruptions, two_mounts
from calibnet.evaluation.drives import shares_mount
from calibnet.evaluation.faults import unaltered
from calibnet.evaluation.faulty import Faulty, farthest
from calibnet.evaluation.runner import draw_miscalibration
from calibnet.geometry import MiscalibrationRange, PoseError, pose_error
from calibnet.geometry.types import Extrinsic
from calibnet.judging.causes import Search
from calibnet.judging.drive import FEWEST_JUDGED
from calibnet.judging.lag import lags
from calibnet.trace import CascadeTrace
from calibnet.verdict import ACCEPTED, CANNOT_TELL, DRIVE_TOLERANCES, FRAME_TOLERANCES, REJECTED, Tolerance, Verdict

PLAIN = Corruption("none", "", None, unaltered, middle=False)
"""A frame without a fault."""
ONE_MOUNT = Corruption("one-mount", "", None, unaltered, middle=False)
"""A drive without a fault."""
DRIVE_FRAMES = 12
"""Largest number of frames of a drive that is put on two mounts."""

Judge = Callable[[Frame, Extrinsic, CascadeTrace | None, Search | None], Verdict]
"""Gives the verdict from a frame, the guess it was calibrated from, the trace (None if the frame could not be
calibrated) and the lags to try."""


@dataclass(frozen=True)
class BatteryRun:
    """One verdict on one frame with one fault.

    Attributes:
        corruption: the fault; `PLAIN` without one.
        error: error of the extrinsic that was judged.
        word: accepted, rejected or cannot tell.
        causes: names of the causes in the verdict.
        tolerances: the tolerance within which an extrinsic is right, and a coarser one.
        within: the tolerance that the verdict is certain of; None if it is certain of none.
    """

    corruption: Corruption
    error: PoseError
    word: str
    causes: tuple[str, ...] = ()
    tolerances: tuple[Tolerance, ...] = FRAME_TOLERANCES
    within: Tolerance | None = None

    @property
    def is_right(self) -> bool:
        """Whether the extrinsic is within the finer tolerance."""
        return self.tolerances[0].holds(self.error)

    @property
    def is_overclaimed(self) -> bool:
        """Whether the verdict is certain of a tolerance, but the extrinsic is not even within the coarser one."""
        return self.within is not None and not self.tolerances[-1].holds(self.error)


@dataclass(frozen=True)
class BatteryRow:
    """Counts of the runs with one fault at one strength, by verdict.

    Attributes:
        corruption, strength: the fault.
        runs: number of runs.
        accepted_right: number accepted that are right.
        accepted_wrong: number accepted that are wrong.
        rejected, cannot_tell: numbers with these verdicts.
        cause_right: number not accepted whose verdict names the cause of the fault.
    """

    corruption: str
    strength: str
    runs: int
    accepted_right: int
    accepted_wrong: int
    rejected: int
    cannot_tell: int
    cause_right: int


@dataclass(frozen=True)
class Battery:
    """All runs of a battery.

    Attributes:
        runs: the single runs.
    """

    runs: tuple[BatteryRun, ...]

    @property
    def rows(self) -> tuple[BatteryRow, ...]:
        """A row for each fault and strength, in the order of their first runs."""
        groups: dict[tuple[str, str], list[BatteryRun]] = {}
        for run in self.runs:
            groups.setdefault((run.corruption.name, run.corruption.strength), []).append(run)
        return tuple(self._row(name, strength, runs) for (name, strength), runs in groups.items())

    @staticmethod
    def _row(name: str, strength: str, runs: Sequence[BatteryRun]) -> BatteryRow:
        accepted = [run for run in runs if run.word == ACCEPTED]
        right = sum(run.is_right for run in accepted)
        unsure = sum(run.word == CANNOT_TELL for run in runs)
        return BatteryRow(
            name,
            strength,
            len(runs),
            accepted_right=right,
            accepted_wrong=len(accepted) - right,
            rejected=len(runs) - len(accepted) - unsure,
            cannot_tell=unsure,
            cause_right=sum(run.word != ACCEPTED and run.corruption.cause in run.causes for run in runs),
        )

    @property
    def false_accept_rate(self) -> float:
        """Share of all runs that are accepted and wrong; NaN without runs."""
        wrong = [run.word == ACCEPTED and not run.is_right for run in self.runs]
        return float(np.mean(wrong)) if wrong else float("nan")

    @property
    def false_claim_rate(self) -> float:
        """Share of all runs that are certain of the coarser tolerance and not within it; NaN without runs."""
        return float(np.mean([run.is_overclaimed for run in self.runs])) if self.runs else float("nan")

    @property
    def acceptance_of_good(self) -> float:
        """Share of accepted runs among those without a fault whose result is right; NaN without such runs."""
        good = [run for run in self.runs if run.corruption.name == PLAIN.name and run.is_right]
        return float(np.mean([run.word == ACCEPTED for run in good])) if good else float("nan")

    def as_dict(self) -> dict[str, Any]:
        """The content of JSON files; a rate without runs is null."""
        names = ("false_accept_rate", "false_claim_rate", "acceptance_of_good")
        rates = {name: getattr(self, name) for name in names}
        return {
            "rows": [vars(row) for row in self.rows],
            **{name: None if np.isnan(rate) else rate for name, rate in rates.items()},
        }


Faults = Callable[[FrameSequence, int], Iterable[Corruption]]
"""The faults to put into the frame at a position of a sequence, see `calibnet.evaluation.corruptions.corruptions`."""


def run_battery(
    cascade: Calibrator,
    judge: Judge,
    sequences: Iterable[FrameSequence],
    faults: Faults,
    range_: MiscalibrationRange,
    repeats: int = 1,
    seed: int = 0,
    observer: Callable[[BatteryRun], None] | None = None,
) -> Battery:
    """Calibrate and judge every frame with every fault, and without.

    Args:
        cascade: the calibrator.
        judge: gives the verdicts to measure.
        sequences: sequences with the frames, whose extrinsics are the truth.
        faults: the faults to put into them.
        range_: range of the miscalibrations; each is the same for all faults of a frame.
        repeats: miscalibrations per frame.
        seed: seed of the miscalibrations.
        observer: called after every run.
    """
    runs = []
    for sequence in sequences:
        for position in range(len(sequence)):
            frame, late = sequence[position], lags(sequence, position)
            for corruption in [PLAIN, *faults(sequence, position)]:
                altered = corruption.put(frame)
                farther = MiscalibrationRange(
                    corruption.farther * range_.rotation_deg, corruption.farther * range_.translation_m
                )
                for repeat in range(repeats):
                    guess = draw_miscalibration(farther, seed, frame.index, repeat) @ frame.camera_from_lidar
                    verdict = judged(cascade, judge, altered, guess, late)
                    error = pose_error(verdict.camera_from_lidar, altered.camera_from_lidar)
                    names = tuple(cause.name for cause in verdict.causes)
                    runs.append(BatteryRun(corruption, error, verdict.word, names, within=verdict.within))
                    if observer is not None:
                        observer(runs[-1])
    return Battery(tuple(runs))


def judged(cascade: Calibrator, judge: Judge, frame: Frame, guess: Extrinsic, late: Search | None = None) -> Verdict:
    """Calibrate one frame from a guess, and judge the result."""
    try:
        trace: CascadeTrace | None = cascade.calibrate(frame, guess)
    except CalibrationError:
        trace = None
    return judge(frame, guess, trace, late)


def measure_battery(
    cascade: Cascade,
    sequences: list[FrameSequence],
    range_: MiscalibrationRange,
    repeats: int = 1,
    seed: int = 0,
    beside: Callable[[], Iterable[FrameSequence]] = lambda: (),
    observer: Callable[[BatteryRun], None] | None = None,
) -> Battery:
    """Run the battery: every fault in every frame, and every drive on two mounts, with verdicts and causes.

    Args:
        cascade: calibrates and judges; it searches for causes of what it does not accept.
        sequences: sequences with the frames, whose extrinsics are the truth.
        range_: range of the miscalibrations.
        repeats: miscalibrations per frame and fault.
        seed: seed of the miscalibrations.
        beside: opens further sequences for images of other places; the synthetic world by default.
        observer: called after every run.
    """
    donors = {id(one): [other_drive(one, list(sequences), beside)[0]] for one in sequences}

    def faults(sequence: FrameSequence, position: int) -> Iterable[Corruption]:
        return corruptions(sequence, position, donors[id(sequence)])

    def judge(frame: Frame, guess: Extrinsic, trace: CascadeTrace | None, late: Search | None) -> Verdict:
        verdict = None if trace is None else trace.verdict
        return verdict if verdict is not None and verdict.word == ACCEPTED else cascade.explain(frame, guess, late)

    of_frames = run_battery(cascade, judge, sequences, faults, range_, repeats, seed, observer).runs
    return Battery((*of_frames, *two_mount_runs(cascade, sequences, range_, repeats, seed, observer)))


def two_mount_runs(
    cascade: Cascade,
    sequences: Iterable[FrameSequence],
    range_: MiscalibrationRange,
    repeats: int = 1,
    seed: int = 0,
    observer: Callable[[BatteryRun], None] | None = None,
) -> list[BatteryRun]:
    """Solve every drive as it is, and with the LiDAR moved in its second half, when no single extrinsic is right.

    The arguments are those of `measure_battery`. The error is relative to the mount that is farther away.
    """
    runs = []
    for sequence in sequences:
        if len(sequence) < FEWEST_JUDGED or not shares_mount(sequence):
            continue
        for fault in (None, *two_mounts(second=True)):
            drive = Faulty(sequence, evenly_spaced(len(sequence), DRIVE_FRAMES), fault, [])
            for repeat in range(repeats):
                guess = draw_miscalibration(range_, seed, 0, repeat) @ sequence[0].camera_from_lidar
                try:
                    verdict = cascade.calibrate_drive(drive, guess).verdict
                except CalibrationError as failed:
                    verdict = Verdict(REJECTED, str(failed), guess)
                assert verdict is not None, "the cascade judges what it finds"
                error = farthest(verdict.camera_from_lidar, drive)
                runs.append(BatteryRun(fault or ONE_MOUNT, error, verdict.word, (), DRIVE_TOLERANCES, verdict.within))
                if observer is not None:
                    observer(runs[-1])
    return runs
