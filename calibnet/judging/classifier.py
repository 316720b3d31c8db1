"""How likely a result is wrong, by its predictors."""

from __future__ import annotations

import math
from dataclasses import dataclass

LARGEST_ODDS = 50.0
"""Of which the logarithm is taken: beyond it, probabilities are 0 and 1 all the same."""


@dataclass(frozen=True)
class Classifier:
    """Logistic regression of a wrong result on the predictors.

    Attributes:
        intercept: of the logarithm of the odds.
        weights: of the predictors, by name.
        accepted_below: probability of being wrong below which a result is accepted.
        rejected_above: probability above which it is rejected; in between nobody can tell.
    """

    intercept: float
    weights: dict[str, float]
    accepted_below: float
    rejected_above: float

    def __call__(self, of: object) -> float:
        """Probability that the result is wrong; not a number where a predictor is missing.

        Args:
            of: what has the predictors as attributes: of a frame, or of a drive.
        """
        odds = self.intercept + sum(weight * getattr(of, name) for name, weight in self.weights.items())
        return odds if math.isnan(odds) else 1 / (1 + math.exp(-min(max(odds, -LARGEST_ODDS), LARGEST_ODDS)))
