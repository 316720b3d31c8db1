"""Predictors of a wrong result of a drive: how well its frames fit, and whether they agree."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from calibnet.geometry import invert, pose_error
from calibnet.geometry.se3 import pose_from_vector
from calibnet.geometry.types import Extrinsic, Vector6
from calibnet.judging.predictors import LEAST
from calibnet.trace import DriveEstimate, DriveLook

DEGREES_A_CENTIMETRE = 0.3 / 8
"""Degrees that count as much as one centimetre, by the ratio of the limits of a drive."""


@dataclass(frozen=True)
class DrivePredictors:
    """Predictors of a wrong extrinsic of a drive; NaN where the estimate lacks the data.

    Attributes:
        match_error: logarithm of the frames' median match error in the last look, in pixels.
        aligned: logarithm of how far the alignment of edges moved the networks' result, in centimetres.
        lens: the frames' median logarithm of how much another lens lowers the cost of the matches.
    """

    match_error: float
    aligned: float
    lens: float


def drive_predictors(estimate: DriveEstimate) -> DrivePredictors | None:
    """The predictors of a drive; None if the method reports no frames."""
    if not estimate.looks:
        return None
    looks = estimate.looks
    return DrivePredictors(
        match_error=math.log(max(float(np.median([look.match_error_px for look in looks])), LEAST)),
        aligned=math.log(max(aligned_cm(estimate), LEAST)),
        lens=float(np.median([math.nan if look.lens is None else look.lens.gain for look in looks])),
    )


def aligned_cm(estimate: DriveEstimate) -> float:
    """How far the alignment of edges moved the networks' result, in centimetres; 0 if nothing was aligned."""
    networks = estimate.networks or estimate
    return _distance(networks.camera_from_lidar, estimate.camera_from_lidar)


def halves_cm(looks: tuple[DriveLook, ...]) -> float:
    """Distance between the results of the first and the second half of a drive, in centimetres."""
    middle = len(looks) // 2
    return apart(agreed(looks[:middle]), agreed(looks[middle:])) if middle else 0.0


def agreed(looks: tuple[DriveLook, ...]) -> Vector6:
    """What frames say in the median, axis by axis."""
    return np.asarray(np.median([look.offset for look in looks], axis=0), np.float64)


def apart(one: Vector6, other: Vector6) -> float:
    """How far two offsets are from each other, in centimetres; a turn counts as in what a drive may be off."""
    return _distance(pose_from_vector(one), pose_from_vector(other))


def _distance(one: Extrinsic, other: Extrinsic) -> float:
    error = pose_error(one @ invert(other), np.eye(4))
    return max(error.translation_cm, error.rotation_deg / DEGREES_A_CENTIMETRE)
