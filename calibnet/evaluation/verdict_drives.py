"""Runs to fit the verdict on drives to: without a fault, with one fault in all frames, or on two mounts."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import asdict

import numpy as np

from calibnet.cascade import Cascade
from calibnet.datasets.frame import Sequence as FrameSequence
from calibnet.datasets.selection import evenly_spaced
from calibnet.errors import CalibnetError
from calibnet.evaluation.battery import PLAIN
from calibnet.evaluation.corruptions import Corruption, corruptions, two_mounts
from calibnet.evaluation.drives import shares_mount
from calibnet.evaluation.faulty import Faulty, farthest, readable
from calibnet.evaluation.verdict_runs import PLAIN_SHARE, VerdictRun, accepting
from calibnet.evaluation.virtual import Virtual
from calibnet.geometry import invert, sample_miscalibration
from calibnet.geometry.se3 import pose_vector
from calibnet.judging.drive import FEWEST_JUDGED
from calibnet.judging.drive_predictors import drive_predictors
from calibnet.trace import DriveEstimate
from calibnet.verdict import ACCEPTED, DRIVE_LIMITS

MOST = 16
"""Largest number of frames of a drive."""
ENOUGH = 8
"""Sequences with fewer frames are drawn in proportion to their length, all others equally often."""
VIRTUAL_SHARE = 0.5
"""Share of drives that are seen through a virtual rig, see `calibnet.evaluation.virtual`."""


class DriveStream:
    """The runs of a cascade on some drives, by number; see `calibnet.evaluation.verdict_runs.RunStream`."""

    def __init__(self, cascade: Cascade, sequences: Iterable[FrameSequence], seed: int) -> None:
        """A run is a part of one of these sequences, as it is or seen by a virtual rig.

        Sequences that are not drives or too short to be judged are left out. Sequences with the same name (cameras of
        one recording) count as one.
        """
        self.cascade, self.seed = accepting(cascade), seed
        self.sequences = [one for one in sequences if len(one) >= FEWEST_JUDGED and shares_mount(one)]
        named = Counter(sequence.name for sequence in self.sequences)
        odds = np.array([min(len(one), ENOUGH) / named[one.name] for one in self.sequences], np.float64)
        self.odds = odds / odds.sum()

    def run(self, number: int) -> VerdictRun | None:
        """The run with this number; None if it cannot be made."""
        generator = np.random.default_rng([self.seed, number, 1])
        if not self.sequences:
            return None
        which = int(generator.choice(len(self.sequences), p=self.odds))
        real, donor = self.sequences[which], self.sequences[(which + 1) % len(self.sequences)]
        sequence = Virtual(real, number, self.seed) if generator.random() < VIRTUAL_SHARE else real
        positions = part(len(sequence), generator)
        fault = PLAIN if generator.random() < PLAIN_SHARE else self.drawn_fault(sequence, generator)
        try:
            drive = Faulty(sequence, positions, None if fault is PLAIN else fault, [donor[0]])
            searched = self.cascade.stages[0].range
            guess = sample_miscalibration(searched, generator) @ sequence[positions[0]].camera_from_lidar
            estimate = self.cascade.calibrate_drive(drive, guess)
            return measured(estimate, drive, number, real.name, fault, self.predictors_of(estimate))
        except CalibnetError:
            return None

    def predictors_of(self, estimate: DriveEstimate) -> dict[str, float] | None:
        """The predictors of a run; None if the verdict needs none."""
        found = drive_predictors(estimate)
        asked = estimate.verdict is not None and estimate.verdict.word == ACCEPTED and found is not None
        return asdict(found) if asked and found is not None else None

    def has(self, fault: Corruption) -> bool:
        """Whether this stream draws a fault; none draws a far start."""
        return True

    def drawn_fault(self, sequence: FrameSequence, generator: np.random.Generator) -> Corruption:
        """A random fault that can be applied to a drive; all names are equally probable."""
        named: dict[str, list[Corruption]] = {}
        for fault in (*corruptions(sequence, len(sequence) // 2, [sequence[0]]), *two_mounts(second=True)):
            if fault.farther == 1 and self.has(fault):
                named.setdefault(fault.name, []).append(fault)
        strengths = named[str(generator.choice(list(named)))]
        return strengths[int(generator.integers(len(strengths)))]


def part(length: int, generator: np.random.Generator) -> list[int]:
    """Positions of a drive's frames: a random number of frames, evenly spaced over a random part of the sequence.

    The same frames from another guess end at nearly the same result; drives differ only if their frames do.
    """
    count = min(length, round(float(np.exp(generator.uniform(np.log(FEWEST_JUDGED), np.log(MOST))))))
    stretch = int(generator.integers(count, length + 1))
    start = int(generator.integers(length - stretch + 1))
    return [start + position for position in evenly_spaced(stretch, count)]


def measured(
    estimate: DriveEstimate,
    drive: Faulty,
    number: int,
    sequence: str,
    fault: Corruption,
    predictors: dict[str, float] | None,
) -> VerdictRun:
    """The run of a drive, with its error, the largest one over its frames."""
    there = estimate.camera_from_lidar
    _, before_verdict = estimate.history[-1]
    error = farthest(there, drive)
    return VerdictRun(
        number,
        sequence,
        estimate.frames,
        fault.name,
        fault.strength,
        error.rotation_deg,
        error.translation_cm,
        DRIVE_LIMITS.holds(error),
        predictors,
        pose_vector(there @ invert(next(readable(drive)).camera_from_lidar)).tolist(),
        np.linalg.inv(before_verdict.covariance).tolist(),
        float("nan"),
    )
