"""Predictors of a wrong result of a drive: how well its frames fit, and whether they agree."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from calibnet.geometry import MiscalibrationRange, invert, pose_error
from calibnet.geometry.se3 import pose_from_vector
from calibnet.geometry.types import Extrinsic, Vector6
from calibnet.judging.predictors import LEAST, reach
from calibnet.trace import DriveEstimate, DriveLook

DEGREES_A_CENTIMETRE = 0.3 / 8
"""Degrees that count as much as one centimetre, by the ratio of the limits of a drive."""
FEWEST = 2
"""Fewest frames that can agree or disagree."""


@dataclass(frozen=True)
class DrivePredictors:
    """Predictors of a wrong extrinsic of a drive; NaN where the estimate lacks the data.

    Attributes:
        match_error: logarithm of the frames' median match error in the last look, in pixels.
        misfit: logarithm of the frames' median misfit.
        lens: median logarithm of the cost of a frame's matches with another lens, relative to the cost with the pose
            alone.
        stated: logarithm of the standard deviation of the translation that all frames together state, in centimetres,
            without the user's prior, which would make any drive look certain.
        scatter: logarithm of the median distance of a frame's result from that of all frames, in centimetres.
        halves: logarithm of the distance between the results of the first and the second half of the drive.
        aligned: logarithm of how far the alignment of edges moved the networks' result.
        reach: how far the result lies from the start, relative to the range searched.
        frames: minus the logarithm of the number of frames.
    """

    match_error: float
    misfit: float
    lens: float
    stated: float
    scatter: float
    halves: float
    aligned: float
    reach: float
    frames: float


def drive_predictors(
    estimate: DriveEstimate, initial: Extrinsic, searched: MiscalibrationRange
) -> DrivePredictors | None:
    """The predictors of a drive; None if the method reports no frames, or fewer than `FEWEST`.

    Args:
        estimate: of the drive.
        initial: ``camera_from_lidar`` that the drive started from.
        searched: range that was searched around the initial extrinsic.
    """
    looks = estimate.looks
    if len(looks) < FEWEST:
        return None
    networks, middle = estimate.networks or estimate, len(looks) // 2
    whole = agreed(looks)
    lens = [math.log(max(min(look.bent_misfit, look.misfit), LEAST) / max(look.misfit, LEAST)) for look in looks]
    return DrivePredictors(
        match_error=_log(np.median([look.match_error_px for look in looks])),
        misfit=_log(np.median([look.misfit for look in looks])),
        lens=float(np.median(lens)),
        stated=_log((estimate.free or networks).translation_cm),
        scatter=_log(np.median([apart(look.offset, whole) for look in looks])),
        halves=_log(apart(agreed(looks[:middle]), agreed(looks[middle:]))),
        aligned=_log(_distance(networks.camera_from_lidar, estimate.camera_from_lidar)),
        reach=reach(initial, estimate.camera_from_lidar, searched).share,
        frames=-math.log(len(looks)),
    )


def agreed(looks: tuple[DriveLook, ...]) -> Vector6:
    """What frames say in the median, axis by axis."""
    return np.asarray(np.median([look.offset for look in looks], axis=0), np.float64)


def apart(one: Vector6, other: Vector6) -> float:
    """How far two offsets are from each other, in centimetres; a turn counts as in what a drive may be off."""
    return _distance(pose_from_vector(one), pose_from_vector(other))


def _distance(one: Extrinsic, other: Extrinsic) -> float:
    error = pose_error(one @ invert(other), np.eye(4))
    return max(error.translation_cm, error.rotation_deg / DEGREES_A_CENTIMETRE)


def _log(value: float | np.floating) -> float:
    return math.log(max(float(value), LEAST))
