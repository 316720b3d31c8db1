"""The covariance of a result: that of a single frame, made as large as actual errors, and that of one known better.

The inverse of the last stage's information treats every match as independent and ignores errors that the whole image
has in common. It is therefore inflated by one factor, and a common part is added. Both are fitted to one set of
weights, see `calibnet.judging.coefficients`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibnet.geometry import MiscalibrationRange
from calibnet.geometry.prior import inverse
from calibnet.geometry.types import Floats, Matrix6
from calibnet.trace import CascadeTrace, StageTrace
from calibnet.verdict import Tolerance

UNSTATED = 1 / 3
"""Share of its range by which a look that states no information is taken to err."""
PIXEL = 2.0
"""Expected match error, in pixels, to which the common part of `CovarianceModel` refers; it grows in proportion."""


@dataclass(frozen=True)
class CovarianceModel:
    """How the errors of results are distributed.

    Attributes:
        independent: effective share of the matches whose errors are independent.
        common_translation_m: standard deviation per axis of the common part, in metres.
        common_rotation_deg: that of the rotation, in degrees.
    """

    independent: float = 1 / 20
    common_translation_m: float = 0.072
    common_rotation_deg: float = 0.38

    def covariance(
        self,
        information: Matrix6,
        last: MiscalibrationRange,
        searched: MiscalibrationRange,
        match_error_px: Floats | float,
    ) -> Matrix6:
        """Covariance ``[..., 6, 6]`` of ``(translation m, rotation rad)`` of a run's result, or of several.

        Args:
            information: ``[..., 6, 6]`` stated by the last stage, including its prior.
            last: range of the last stage, which determines that prior.
            searched: range around the guess, the prior before any match is used.
            match_error_px: ``[...]`` match error that the last stage expects.
        """
        matches = self.independent * (information - last.information)
        axes = np.repeat([self.common_translation_m, np.radians(self.common_rotation_deg)], 3)
        sigma = axes * np.asarray(match_error_px)[..., None] / PIXEL
        return np.asarray(np.linalg.inv(matches + searched.information) + sigma[..., None] ** 2 * np.eye(6), np.float64)

    def weight(self, look: StageTrace) -> Matrix6:
        """What the correction of a look counts beside other knowledge: the inverse ``[6, 6]`` of its covariance."""
        range_ = look.range
        if look.information is None:
            return range_.information / UNSTATED**2
        return inverse(self.covariance(look.information, range_, range_, look.match_error_px))


def covariance(trace: CascadeTrace, model: CovarianceModel) -> Matrix6 | None:
    """Covariance ``[6, 6]`` of ``(translation m, rotation rad)`` of a frame's result, perturbed in the camera frame.

    None if the last stage states no information.
    """
    last = trace.stages[-1]
    if last.information is None:
        return None
    return model.covariance(last.information, last.range, trace.stages[0].range, last.match_error_px)


def known_within(covariance: Matrix6, tolerance: Tolerance) -> Matrix6:
    """The covariance ``[6, 6]`` of an error that is certain to be within a tolerance.

    Of errors with the given covariance, only those within the tolerance remain. A normal distribution that is cut off
    at ``k`` standard deviations in three dimensions keeps ``P(chi2_5 < k^2) / P(chi2_3 < k^2)`` of its variance.
    Rotation and translation are cut off one by one, each as if it were alike along all axes.
    """
    from scipy.special import gammainc

    shares = np.empty(6)
    for axes, limit in ((slice(3), tolerance.translation_cm / 100), (slice(3, 6), np.radians(tolerance.rotation_deg))):
        half = limit**2 / (2 * np.trace(covariance[axes, axes]) / 3)
        shares[axes] = gammainc(2.5, half) / gammainc(1.5, half)
    scale = np.sqrt(shares)
    return np.asarray(scale[:, None] * covariance * scale, np.float64)
