"""Whether a calibration that somebody has is good: what a frame or a drive finds from there, held against it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from calibnet.geometry import PoseError, pose_error
from calibnet.geometry.se3 import invert, pose_vector
from calibnet.geometry.types import Extrinsic, Floats, Matrix6, Vector6
from calibnet.judging.drive import FEWEST_JUDGED
from calibnet.verdict import ACCEPTED, CANNOT_TELL, DRIVE_LIMITS, FRAME_LIMITS, REJECTED, Cause, Verdict, Word, moved

SIGNIFICANT = 16.27
"""99.9 % quantile of chi-square with three degrees of freedom: those of the rotation, or of the translation."""
PROBABLE = 0.95
"""Probability of being within the tolerance from which on a calibration is accepted."""
BAND = 1.96
"""Standard deviations on either side that hold 95 % of a normal distribution."""
SAMPLES = 100_000
"""Draws for that probability: at 95 % it is told to 0.07 %, and drawn alike every time."""
ROTATION, TRANSLATION = slice(3, 6), slice(0, 3)
"""Rows of a covariance."""
TURNS = {"pitch_deg": "pitch", "yaw_deg": "yaw", "roll_deg": "roll"}
SHIFTS = {"x_cm": "x (right)", "y_cm": "y (down)", "z_cm": "z (ahead)"}


@dataclass(frozen=True)
class Tolerance:
    """How far off a calibration may be to count as good."""

    rotation_deg: float
    translation_cm: float

    def __str__(self) -> str:
        return f"{self.rotation_deg:g}° / {self.translation_cm:g} cm"


@dataclass(frozen=True)
class Standard:
    """What the calibration of a frame, or of a drive, is held to.

    Attributes:
        tolerances: how far off is good, finest first: the limits that the verdict holds results to, where a result is
            sure enough to tell so little, and what the others can tell.
        farthest: how far from the truth a result of several frames is at most that is not sure enough to be accepted;
            None where that is not known.
    """

    tolerances: tuple[Tolerance, ...]
    farthest: Tolerance | None = None


FRAME = Standard((Tolerance(*FRAME_LIMITS), Tolerance(1.5, 40.0)))
DRIVE = Standard((Tolerance(*DRIVE_LIMITS), Tolerance(0.5, 15.0)), Tolerance(1.6, 40.0))
"""Standards of a single frame, for which no farthest is known, and of a drive: half as far again as the farthest of the
drives that the verdict was fitted to (1.1°, 26 cm)."""


def verify(given: Extrinsic, found: Verdict, standard: Standard) -> Verdict:
    """Hold a calibration against what was found from there.

    It is rejected if it is off by more than the finest tolerance that the covariance of what was found can tell, in
    rotation or in translation, and if that is significant (chi-square, 99.9 %). It is accepted if it is within one of
    the tolerances with a probability of 95 %, and the finest of these is told. Otherwise nobody can tell. Where what
    was found is not accepted itself, the calibration is rejected if causes are known, for then the input is wrong, or
    if it is farther from what was found than that can be from the truth; else nobody can tell.

    Args:
        given: ``camera_from_lidar`` to verify, 4x4.
        found: verdict on the estimate of a frame or of a drive that started there, with its covariance.
        standard: `FRAME` or `DRIVE`.

    Returns:
        A verdict on ``given``. Its ``camera_from_lidar`` is what was found, and ``moved`` leads there from ``given``.
    """
    estimate = found.camera_from_lidar

    def verdict(word: Word, reason: str) -> Verdict:
        return replace(found, word=word, reason=reason, moved=moved(given, estimate))

    error = pose_error(given, estimate)
    skipped, tried = len(found.skipped), found.used + len(found.skipped)
    few = f"{skipped} of {tried} frames do not fit or cannot be read." if 2 * skipped >= tried else None
    if found.word != ACCEPTED:
        if found.word == REJECTED and found.causes:
            return verdict(REJECTED, found.reason)
        apart = f"{error.rotation_deg:.1f}° and {error.translation_cm:.0f} cm"
        if few is None and _is_far(error, found, standard):
            reason = f"The calibration is off by some {apart}, or the input is wrong; how far exactly is not sure."
            return verdict(REJECTED, f"{reason} {found.reason}")
        if few is None and found.word == CANNOT_TELL:
            reason = f"The calibration lies {apart} from what is found, which is not sure enough to hold it against."
            return verdict(CANNOT_TELL, f"{reason} {found.reason}")
        return verdict(CANNOT_TELL, f"There is nothing to hold the calibration against. {found.reason}")
    if few is not None:
        return verdict(CANNOT_TELL, few)
    if found.covariance is None:
        off = f"{error.rotation_deg:.2f}° / {error.translation_cm:.1f} cm"
        return verdict(CANNOT_TELL, f"The calibration seems to be off by {off}, but nothing states how sure that is.")
    offset = pose_vector(given @ invert(estimate))
    off = _said(error, offset, found.covariance)
    still = np.zeros(6)
    told = next(
        (one for one in standard.tolerances if probability_within(still, found.covariance, one) >= PROBABLE),
        standard.tolerances[-1],
    )
    if _is_beyond(error, offset, found.covariance, told):
        return verdict(REJECTED, f"The calibration is off by {off}; {told} are tolerated.")
    for tolerance in standard.tolerances:
        share = probability_within(offset, found.covariance, tolerance)
        if share >= PROBABLE:
            return verdict(ACCEPTED, f"The calibration is off by no more than {tolerance}: by {off}.")
    return verdict(
        CANNOT_TELL, f"The calibration is off by {off}; that it is within {tolerance} is {share:.0%} probable."
    )


def unfit(given: Extrinsic, reason: str, causes: tuple[Cause, ...] = ()) -> Verdict:
    """The verdict where nothing could be found, because picture and scan do not fit together.

    Args:
        given: ``camera_from_lidar`` to verify, 4x4.
        reason: why nothing could be found.
        causes: what is wrong with the input; with any the calibration is rejected, without nobody can tell.
    """
    return Verdict(REJECTED if causes else CANNOT_TELL, reason, given, causes=causes, used=0)


def named_cause(error: BaseException | None) -> tuple[Cause, ...]:
    """What an error that names a cause in its attribute ``cause`` says is wrong with input that can be read.

    An error that was raised from such a one is taken for it.
    """
    while error is not None:
        name = getattr(error, "cause", "")
        if name:
            return (Cause(name, str(error), "seen when the input was read"),)
        error = error.__cause__
    return ()


def probability_within(offset: Vector6, covariance: Matrix6, tolerance: Tolerance) -> float:
    """Probability that rotation and translation are both within the tolerance.

    Args:
        offset: ``(translation m, rotation rad)`` of the calibration against the estimate.
        covariance: ``[6, 6]`` of it.
        tolerance: how far off is good.
    """
    variances, axes = np.linalg.eigh(covariance)
    draws = offset[:, None] + (axes * np.sqrt(np.maximum(variances, 0.0))) @ _draws()
    turned, shifted = ((draws[rows] ** 2).sum(axis=0) for rows in (ROTATION, TRANSLATION))
    within = turned <= np.radians(tolerance.rotation_deg) ** 2
    return float((within & (shifted <= (tolerance.translation_cm / 100) ** 2)).mean())


@cache
def _draws() -> Floats:
    """``[6, SAMPLES]`` of the standard normal distribution: a fleet asks ten thousand times."""
    return np.ascontiguousarray(np.random.default_rng(0).standard_normal((SAMPLES, 6)).T)


def _is_far(error: PoseError, found: Verdict, standard: Standard) -> bool:
    """Whether a calibration is farther from what several frames agree on than they can be from the truth.

    Frames that do not fit are skipped, so those of a drive that leaves the range searched agree, too.
    """
    farthest = standard.farthest
    if farthest is None or found.used < FEWEST_JUDGED:
        return False
    return error.rotation_deg > farthest.rotation_deg or error.translation_cm > farthest.translation_cm


def _is_beyond(error: PoseError, offset: Vector6, covariance: Matrix6, tolerance: Tolerance) -> bool:
    """Whether rotation or translation exceeds the tolerance, significantly by itself.

    Each is tested alone: a small turn that is very sure says nothing of a large shift that is not.
    """
    too_far = (
        (ROTATION, error.rotation_deg > tolerance.rotation_deg),
        (TRANSLATION, error.translation_cm > tolerance.translation_cm),
    )
    return any(
        far and offset[rows] @ np.linalg.solve(covariance[rows, rows], offset[rows]) > SIGNIFICANT
        for rows, far in too_far
    )


def _said(error: PoseError, offset: Vector6, covariance: Matrix6) -> str:
    """How far off, about and along which axis most, and how sure that is."""
    turn = float(np.degrees(BAND * _deviation(offset[ROTATION], covariance[ROTATION, ROTATION])))
    shift = float(100 * BAND * _deviation(offset[TRANSLATION], covariance[TRANSLATION, TRANSLATION]))
    about, along = _most(error, TURNS), _most(error, SHIFTS)
    return (
        f"{error.rotation_deg:.2f}° ± {turn:.2f}° (most of it {TURNS[about]}, {getattr(error, about):+.2f}°) and "
        f"{error.translation_cm:.1f} ± {shift:.1f} cm (most of it {SHIFTS[along]}, {getattr(error, along):+.1f} cm)"
    )


def _most(error: PoseError, axes: dict[str, str]) -> str:
    """The axis with the largest share of an error."""
    return max(axes, key=lambda axis: abs(getattr(error, axis)))


def _deviation(vector: Floats, covariance: Floats) -> float:
    """Standard deviation in the direction of a vector, or the largest where it has none."""
    length = float(np.linalg.norm(vector))
    if length < 1e-9:
        return float(np.sqrt(np.linalg.eigvalsh(covariance)[-1]))
    direction = vector / length
    return float(np.sqrt(direction @ covariance @ direction))
