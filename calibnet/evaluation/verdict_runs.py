"""Runs to fit the verdict to: frames with and without one of the battery's faults, and the predictors of each run.

The stream of runs is endless. A run depends only on the seed and its number, so a longer stream begins with a shorter
one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache

import numpy as np

from calibnet.cascade import Cascade
from calibnet.cascade.prepared import prepared
from calibnet.cascade.upright import Upright
from calibnet.datasets.frame import Frame
from calibnet.datasets.frame import Sequence as FrameSequence
from calibnet.datasets.selection import evenly_spaced
from calibnet.errors import CalibnetError
from calibnet.evaluation.battery import PLAIN
from calibnet.evaluation.corruptions import Corruption, corruptions
from calibnet.geometry import MiscalibrationRange, invert, pose_error, sample_miscalibration
from calibnet.geometry.se3 import pose_vector
from calibnet.geometry.types import Extrinsic
from calibnet.judging.classifier import Classifier
from calibnet.judging.coefficients import Coefficients
from calibnet.judging.predictors import predictors
from calibnet.trace import CascadeTrace
from calibnet.verdict import ACCEPTED, FRAME_LIMITS

FRAMES = 8
"""Frames used of a sequence, evenly spaced, since neighbouring frames are much the same."""
KEPT = 16
"""Frames kept in memory, some 10 MB each."""
PLAIN_SHARE = 0.5
"""Share of runs without a fault, which show how many good results are accepted."""


@dataclass(frozen=True)
class VerdictRun:
    """One calibration of a frame or of a drive from a random guess.

    Attributes:
        number: number of the run in the stream.
        sequence: name of the sequence.
        frame: index of the frame, or the number of frames of a drive.
        fault, strength: the fault that was applied, see `calibnet.evaluation.corruptions`.
        rotation_deg, translation_cm: error of the result.
        good: whether the error is within the limits.
        predictors: by name; None if the verdict needs none, for instance because image and scan do not fit.
        offset: error of the result as ``(translation m, rotation rad)`` in the camera frame.
        information: ``[6, 6]`` of the last stage, or of the drive; None without one.
        match_error_px: match error that the last stage expects; NaN for a drive.
    """

    number: int
    sequence: str
    frame: int
    fault: str
    strength: str
    rotation_deg: float
    translation_cm: float
    good: bool
    predictors: dict[str, float] | None
    offset: list[float]
    information: list[list[float]] | None
    match_error_px: float

    @property
    def plain(self) -> bool:
        """Whether the run has no fault."""
        return self.fault == PLAIN.name


@dataclass(frozen=True, eq=False)
class Drawn:
    """The input of a run.

    Attributes:
        sequence: name of the frame's sequence.
        fault: fault that was applied to the frame.
        frame: the frame with the fault; its extrinsic is the truth.
        guess: ``camera_from_lidar`` to start from.
    """

    sequence: str
    fault: Corruption
    frame: Frame
    guess: Extrinsic


class RunStream:
    """The runs of a cascade on some sequences, by number."""

    def __init__(self, cascade: Cascade, sequences: Sequence[FrameSequence], seed: int) -> None:
        """A run is a random frame of a random sequence; all sequences are equally probable.

        Args:
            cascade: the cascade; its verdict is replaced as in `accepting`.
            sequences: at least one; images of other places come from other sequences.
            seed: seed of all random numbers.
        """
        self.cascade, self.sequences, self.seed = accepting(cascade), list(sequences), seed
        self.read = lru_cache(KEPT)(lambda sequence, position: self.sequences[sequence][position])

    def run(self, number: int) -> VerdictRun | None:
        """The run with this number; None if its frame cannot be read or has too few points in the image."""
        try:
            return measured(self.cascade, self.drawn(number), number, self.predictors_of)
        except CalibnetError:
            return None

    def predictors_of(self, trace: CascadeTrace) -> dict[str, float] | None:
        """The predictors of a run; None if the verdict needs none."""
        asked = trace.verdict is not None and trace.verdict.word == ACCEPTED
        return asdict(predictors(trace)) if asked else None

    def has(self, fault: Corruption) -> bool:
        """Whether this stream draws a fault."""
        return True

    def drawn(self, number: int) -> Drawn:
        """Draw the input of the run with a number.

        Raises:
            DatasetError: its frame cannot be read.
        """
        generator = np.random.default_rng([self.seed, number])
        which = int(generator.integers(len(self.sequences)))
        sequence = self.sequences[which]
        position = int(generator.choice(evenly_spaced(len(sequence), FRAMES)))
        fault = PLAIN if generator.random() < PLAIN_SHARE else self._fault(which, position, generator)
        frame, first = self.read(which, position), self.cascade.stages[0].range
        range_ = MiscalibrationRange(fault.farther * first.rotation_deg, fault.farther * first.translation_m)
        guess = sample_miscalibration(range_, generator) @ frame.camera_from_lidar
        return Drawn(sequence.name, fault, fault.put(frame), guess)

    def _fault(self, which: int, position: int, generator: np.random.Generator) -> Corruption:
        """A random fault that can be applied to this frame; all names are equally probable."""
        others = [other for other in range(len(self.sequences)) if other != which]
        donors = [self.read(int(generator.choice(others)), 0)] if others else []
        named: dict[str, list[Corruption]] = {}
        for fault in filter(self.has, corruptions(self.sequences[which], position, donors)):
            named.setdefault(fault.name, []).append(fault)
        strengths = named[str(generator.choice(list(named)))]
        return strengths[int(generator.integers(len(strengths)))]


def measured(
    cascade: Cascade, drawn: Drawn, number: int, predictors_of: Callable[[CascadeTrace], dict[str, float] | None]
) -> VerdictRun:
    """Calibrate a frame, and compute the error and the predictors of the result.

    Args:
        cascade: the cascade.
        drawn: the input of the run.
        number: number of the run in the stream.
        predictors_of: computes the predictors from the trace.

    Raises:
        CalibrationError: too few points fall into the image.
    """
    upright = Upright.of(drawn.guess, cascade.stages[0].range)
    frame, start = prepared(drawn.frame, upright), upright.extrinsic(drawn.guess)
    trace = cascade.calibrate(frame, start)
    last, truth = trace.stages[-1], frame.camera_from_lidar
    error = pose_error(last.after, truth)
    return VerdictRun(
        number,
        drawn.sequence,
        frame.index,
        drawn.fault.name,
        drawn.fault.strength,
        error.rotation_deg,
        error.translation_cm,
        FRAME_LIMITS.holds(error),
        predictors_of(trace),
        pose_vector(last.after @ invert(truth)).tolist(),
        None if last.information is None else last.information.tolist(),
        last.match_error_px,
    )


def accepting(cascade: Cascade) -> Cascade:
    """The cascade with a verdict that accepts every result for which it needs the classifier's predictors."""
    everything = Classifier(0.0, {}, accepted_below=1.0, rejected_above=1.0)
    finest = cascade.stages[-1].range
    return cascade.with_coefficients(Coefficients(everything, drive=everything, weights={finest: ""}, missing=""))
