"""The probability that a result is wrong, given its predictors."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from calibnet.verdict import Tolerance

LARGEST_LOG_ODDS = 50.0
"""Log odds are clipped to plus or minus this, beyond which probabilities are 0 and 1 in double precision anyway."""


@dataclass(frozen=True)
class Classifier:
    """Logistic regression on predictors, with the two thresholds of the verdict.

    Attributes:
        intercept: log odds of a wrong result if all predictors are 0.
        weights: change of the log odds per unit of each predictor, by its name.
        accepted_below: results with a smaller probability of being wrong are accepted.
        rejected_above: results with a larger one are rejected; in between the verdict is *cannot tell*.
        coarser: the same for the next coarser tolerance; None if there is none.
    """

    intercept: float
    weights: dict[str, float]
    accepted_below: float
    rejected_above: float
    coarser: Classifier | None = None

    def __call__(self, of: object) -> float:
        """Probability that a result is wrong; NaN if a predictor is NaN.

        Args:
            of: an object whose attributes are the predictors, `Predictors` or `DrivePredictors`.
        """
        odds = self.intercept + sum(weight * getattr(of, name) for name, weight in self.weights.items())
        return odds if math.isnan(odds) else 1 / (1 + math.exp(-min(max(odds, -LARGEST_LOG_ODDS), LARGEST_LOG_ODDS)))

    def finest(self, of: object, tolerances: Sequence[Tolerance]) -> Tolerance | None:
        """The finest tolerance that a result is certain enough to be within; None if there is none.

        Args:
            of: its predictors.
            tolerances: that of this classifier, and the coarser ones.
        """
        if not tolerances or self(of) < self.accepted_below:
            return next(iter(tolerances), None)
        return self.coarser.finest(of, tolerances[1:]) if self.coarser is not None else None
