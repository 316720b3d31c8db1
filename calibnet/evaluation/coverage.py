"""Measures whether stated covariances are as large as the errors.

The measures are the normalised estimation error squared (NEES) and the share of errors within the 95 % region.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass

import numpy as np

from calibnet.geometry.se3 import invert, pose_vector
from calibnet.geometry.types import Extrinsic, Matrix6

FREEDOM = 6
WITHIN_95 = 12.592
"""95 % quantile of the chi-square distribution with six degrees of freedom."""
MEDIAN = 5.348
"""Median of the same distribution."""


@dataclass(frozen=True)
class Coverage:
    """How stated covariances compare with errors.

    Attributes:
        runs: number of runs that state a covariance.
        squared: NEES per degree of freedom: 1 if errors are as large as stated, more if they are larger.
        squared_error: standard error of ``squared``; NaN for a single run.
        median: median NEES relative to the median of chi-square, which single gross errors hardly affect.
        within: share of errors within the 95 % region.
        within_error: standard error of ``within``.
    """

    runs: int
    squared: float
    squared_error: float
    median: float
    within: float
    within_error: float

    @classmethod
    def of(cls, squares: Iterable[float]) -> Coverage | None:
        """The coverage of runs from their `squared_error`; None if no run states a covariance."""
        known = np.array([square for square in squares if np.isfinite(square)])
        if not len(known):
            return None
        within = float((known < WITHIN_95).mean())
        return cls(
            len(known),
            float(known.mean() / FREEDOM),
            float(known.std(ddof=1) / FREEDOM / np.sqrt(len(known))) if len(known) > 1 else float("nan"),
            float(np.median(known) / MEDIAN),
            within,
            float(np.sqrt(max(within * (1 - within), 0.05 * 0.95) / len(known))),
        )

    def __str__(self) -> str:
        if self.runs == 1:
            where = "within" if self.within else "outside"
            return f"squared error {self.squared:.2f} per degree of freedom, {where} the 95 % region, 1 run"
        return (
            f"squared error {self.squared:.2f} ± {self.squared_error:.2f} per degree of freedom (median "
            f"{self.median:.2f}), {self.within:.0%} ± {self.within_error:.0%} within the 95 % region, {self.runs} runs"
        )

    def as_dict(self) -> dict[str, float | None]:
        """The content of JSON files; figures that need more than one run are null."""
        return {name: value if np.isfinite(value) else None for name, value in asdict(self).items()}


def squared_error(found: Extrinsic, truth: Extrinsic, covariance: Matrix6 | None) -> float:
    """The squared error ``e^T C^-1 e`` of an extrinsic with covariance ``[6, 6]``; NaN without a covariance."""
    if covariance is None:
        return float("nan")
    offset = pose_vector(found @ invert(truth))
    return float(offset @ np.linalg.solve(covariance, offset))
