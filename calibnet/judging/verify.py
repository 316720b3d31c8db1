"""Whether an existing calibration is good: it is compared with the result of a run that starts from it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from calibnet.geometry import PoseError, degrees_and_cm, pose_error
from calibnet.geometry.se3 import invert, pose_vector
from calibnet.geometry.types import Extrinsic, Floats, Matrix6, Vector6
from calibnet.judging.advice import CORRECT_IT, LOOK_AT_BOTH, NARROWER
from calibnet.judging.drive import FEWEST_JUDGED
from calibnet.verdict import (
    ACCEPTED,
    CANNOT_TELL,
    DRIVE_TOLERANCES,
    FRAME_TOLERANCES,
    REJECTED,
    Cause,
    Tolerance,
    Verdict,
    Word,
    moved,
)

SIGNIFICANT = 16.27
"""99.9 % quantile of chi-square with three degrees of freedom, for the rotation or the translation."""
PROBABLE = 0.95
"""A calibration is accepted if it is within the tolerance with at least this probability."""
BAND = 1.96
"""Standard deviations on either side that hold 95 % of a normal distribution."""
SAMPLES = 100_000
"""Random draws for that probability, the same every time; at 95 % its standard error is 0.07 %."""
ROTATION, TRANSLATION = slice(3, 6), slice(0, 3)
"""Rows of a covariance."""
TURNS = {"pitch_deg": "pitch", "yaw_deg": "yaw", "roll_deg": "roll"}
SHIFTS = {"x_cm": "x (right)", "y_cm": "y (down)", "z_cm": "z (ahead)"}


@dataclass(frozen=True)
class Standard:
    """The tolerances that the calibration of a frame, or of a drive, is compared with.

    Attributes:
        tolerances: finest first; those that the result is not certain enough to be within itself are not used.
        farthest: largest error of a result of several frames that is not certain enough to be accepted; None if that is
            unknown.
    """

    tolerances: tuple[Tolerance, ...]
    farthest: Tolerance | None = None


FRAME, DRIVE = Standard(FRAME_TOLERANCES), Standard(DRIVE_TOLERANCES, Tolerance(1.6, 40.0))
"""Standards of a single frame, whose ``farthest`` is unknown, and of a drive, for which it is one and a half times the
largest error among the drives that the verdict was fitted to (1.1°, 26 cm)."""


def verify(given: Extrinsic, found: Verdict, standard: Standard) -> Verdict:
    """Compare a calibration with the result of a run that started from it.

    If the result is accepted, or certain enough to be within a coarser tolerance (`Verdict.within`), the calibration is

    - rejected if its rotation or translation is significantly off (chi-square, 99.9 %) by more than the finest
      tolerance that the result can resolve,
    - accepted if it is within one of the tolerances with a probability of 95 %; the finest such tolerance is named,
    - *cannot tell* otherwise.

    These probabilities follow from the covariance of the result, and from the coarsest tolerance, which it is certainly
    within. If the result is certain of nothing, the calibration is rejected if a cause is known, because the input is
    wrong then, or if it lies farther from the result than the result can lie from the truth; otherwise it is
    *cannot tell*.

    Args:
        given: ``camera_from_lidar`` to verify, 4x4.
        found: verdict on the estimate of a frame or of a drive that started there, with its covariance.
        standard: `FRAME` or `DRIVE`.

    Returns:
        A verdict on ``given``. Its ``camera_from_lidar`` is the result, ``moved`` is its distance from ``given``, and
        ``within`` is the tolerance that ``given`` is within.
    """
    estimate = found.camera_from_lidar

    def verdict(word: Word, reason: str, within: Tolerance | None = None, advice: str = found.advice) -> Verdict:
        advice = "" if word == ACCEPTED or found.causes else advice  # a cause says what to do
        return replace(found, word=word, reason=reason, moved=moved(given, estimate), within=within, advice=advice)

    error = pose_error(given, estimate)
    skipped, tried = len(found.skipped), found.used + len(found.skipped)
    few = None
    if 2 * skipped >= tried:
        few = f"{skipped} of {tried} frames do not fit or cannot be read. {found.skipped[0].why}"
    if found.word != ACCEPTED and found.within is None:
        if found.word == REJECTED and found.causes:
            return verdict(REJECTED, found.reason)
        apart = f"{error.rotation_deg:.1f}° and {error.translation_cm:.0f} cm"
        if few is None and _is_far(error, found, standard):
            reason = f"The calibration is off by about {apart}, or the input is wrong; the exact amount is uncertain."
            return verdict(REJECTED, f"{reason} {found.reason}", advice=LOOK_AT_BOTH)
        if few is None and found.word == CANNOT_TELL:
            reason = f"The calibration differs by {apart} from the result, which is too uncertain to judge it by."
            return verdict(CANNOT_TELL, f"{reason} {found.reason}")
        return verdict(CANNOT_TELL, f"There is no result to compare the calibration with. {found.reason}")
    if few is not None:
        return verdict(CANNOT_TELL, few)
    if found.covariance is None:
        off = degrees_and_cm(error.rotation_deg, error.translation_cm)
        return verdict(
            CANNOT_TELL, f"The calibration seems to be off by {off}, but the uncertainty of that is unknown."
        )
    offset = pose_vector(given @ invert(estimate))
    off = _in_words(error, offset, found.covariance)
    tolerances = [one for one in standard.tolerances if found.within is None or one >= found.within]
    certain = None if found.within is None else tolerances[-1]
    errors = possible_errors(found.covariance, certain)
    resolved = next((one for one in tolerances if probability_within(errors, one) >= PROBABLE), tolerances[-1])
    if _is_beyond(error, offset, found.covariance, resolved):
        return verdict(REJECTED, f"The calibration is off by {off}; the tolerance is {resolved}.", advice=CORRECT_IT)
    for tolerance in tolerances:
        share = probability_within(offset[:, None] + errors, tolerance)
        if share >= PROBABLE:
            return verdict(ACCEPTED, f"The calibration is off by no more than {tolerance}: {off}.", tolerance)
    reason = f"The calibration is off by {off}; the probability that it is within {tolerance} is {share:.0%}."
    return verdict(CANNOT_TELL, reason, advice=NARROWER)


def unfit(given: Extrinsic, reason: str, causes: tuple[Cause, ...] = ()) -> Verdict:
    """The verdict if there is no result, because image and scan do not fit together.

    Args:
        given: ``camera_from_lidar`` to verify, 4x4.
        reason: why there is no result.
        causes: what is wrong with the input. With a cause the calibration is rejected, otherwise it is *cannot tell*.
    """
    return Verdict(REJECTED if causes else CANNOT_TELL, reason, given, causes=causes, used=0)


def named_cause(error: BaseException | None) -> tuple[Cause, ...]:
    """The cause that an error, or the error it was raised from, names in its attribute ``cause``.

    Such errors are about input that can be read but cannot be right.
    """
    while error is not None:
        name = getattr(error, "cause", "")
        if name:
            return (Cause(name, str(error), "seen when the input was read"),)
        error = error.__cause__
    return ()


def possible_errors(covariance: Matrix6, certain: Tolerance | None = None) -> Floats:
    """Random errors ``[6, N]`` of an estimate, ``(translation m, rotation rad)``.

    Args:
        covariance: ``[6, 6]`` of the estimate.
        certain: the tolerance that the estimate is certainly within, if one is known.
    """
    variances, axes = np.linalg.eigh(covariance)
    errors = (axes * np.sqrt(np.maximum(variances, 0.0))) @ _draws()
    return np.asarray(errors if certain is None else errors[:, _within(errors, certain)], np.float64)


def probability_within(errors: Floats, tolerance: Tolerance) -> float:
    """Share of errors ``[6, N]`` whose rotation and translation are both within a tolerance."""
    return float(_within(errors, tolerance).mean()) if errors.size else 0.0


def _within(vectors: Floats, tolerance: Tolerance) -> NDArray[np.bool_]:
    """Which of the vectors ``[6, N]`` are within a tolerance."""
    turned, shifted = ((vectors[rows] ** 2).sum(axis=0) for rows in (ROTATION, TRANSLATION))
    within = shifted <= (tolerance.translation_cm / 100) ** 2
    return np.asarray(within & (turned <= np.radians(tolerance.rotation_deg) ** 2))


@cache
def _draws() -> Floats:
    """``[6, SAMPLES]`` of the standard normal distribution: a fleet asks ten thousand times."""
    return np.ascontiguousarray(np.random.default_rng(0).standard_normal((SAMPLES, 6)).T)


def _is_far(error: PoseError, found: Verdict, standard: Standard) -> bool:
    """Whether a calibration lies farther from the result of several frames than that result can lie from the truth.

    Frames that do not fit are skipped, so this holds for a drive that leaves the range searched as well.
    """
    farthest = standard.farthest
    if farthest is None or found.used < FEWEST_JUDGED:
        return False
    return error.rotation_deg > farthest.rotation_deg or error.translation_cm > farthest.translation_cm


def _is_beyond(error: PoseError, offset: Vector6, covariance: Matrix6, tolerance: Tolerance) -> bool:
    """Whether rotation or translation significantly exceeds the tolerance.

    Each is tested by itself: a small but very certain rotation says nothing about a large, uncertain translation.
    """
    too_far = (
        (ROTATION, error.rotation_deg > tolerance.rotation_deg),
        (TRANSLATION, error.translation_cm > tolerance.translation_cm),
    )
    return any(
        far and offset[rows] @ np.linalg.solve(covariance[rows, rows], offset[rows]) > SIGNIFICANT
        for rows, far in too_far
    )


def _in_words(error: PoseError, offset: Vector6, covariance: Matrix6) -> str:
    """The error with its uncertainty, and the axes with the largest shares of it."""
    turn = float(np.degrees(BAND * _deviation(offset[ROTATION], covariance[ROTATION, ROTATION])))
    shift = float(100 * BAND * _deviation(offset[TRANSLATION], covariance[TRANSLATION, TRANSLATION]))
    about, along = _most(error, TURNS), _most(error, SHIFTS)
    return (
        f"{error.rotation_deg:.2f}° ± {turn:.2f}° (most of it {TURNS[about]}, {getattr(error, about):+.2f}°) and "
        f"{error.translation_cm:.1f} ± {shift:.1f} cm (most of it {SHIFTS[along]}, {getattr(error, along):+.1f} cm)"
    )


def _most(error: PoseError, axes: dict[str, str]) -> str:
    """The axis that contributes most to an error."""
    return max(axes, key=lambda axis: abs(getattr(error, axis)))


def _deviation(vector: Floats, covariance: Floats) -> float:
    """Standard deviation in the direction of a vector, or the largest one for a zero vector."""
    length = float(np.linalg.norm(vector))
    if length < 1e-9:
        return float(np.sqrt(np.linalg.eigvalsh(covariance)[-1]))
    direction = vector / length
    return float(np.sqrt(direction @ covariance @ direction))
