"""The uncertainty of a single frame's result: what the last stage states, made as large as its errors are.

The inverse of the stage's information counts every match as independent and knows nothing of what the networks get
wrong alike in a whole picture. It is widened by one factor, and a common part is added. Both are fitted to one set of
weights, see `calibnet.judging.coefficients`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibnet.geometry import MiscalibrationRange
from calibnet.geometry.types import Floats, Matrix6
from calibnet.trace import CascadeTrace

PIXEL = 2.0
"""Expected match error, in pixels, to which the common part of `CovarianceModel` refers; it grows in proportion."""


@dataclass(frozen=True)
class CovarianceModel:
    """How far results lie from the truth.

    Attributes:
        independent: share of the matches that err independently.
        common_translation_m: standard deviation, an axis, of what does not follow from the matches' own errors.
        common_rotation_deg: likewise of the rotation.
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
            information: ``[..., 6, 6]`` as the last stage states it, its prior included.
            last: its range, from which it takes that prior.
            searched: the range around the guess: what is known without matches.
            match_error_px: ``[...]`` that the last stage expects.
        """
        matches = self.independent * (information - last.information)
        axes = np.repeat([self.common_translation_m, np.radians(self.common_rotation_deg)], 3)
        sigma = axes * np.asarray(match_error_px)[..., None] / PIXEL
        return np.asarray(np.linalg.inv(matches + searched.information) + sigma[..., None] ** 2 * np.eye(6), np.float64)


def covariance(trace: CascadeTrace, model: CovarianceModel) -> Matrix6 | None:
    """Covariance ``[6, 6]`` of ``(translation m, rotation rad)`` of a run on a frame; None where no stage states one.

    A perturbation of the result in the camera frame.
    """
    last = trace.stages[-1]
    if last.information is None:
        return None
    return model.covariance(last.information, last.range, trace.stages[0].range, last.match_error_px)
