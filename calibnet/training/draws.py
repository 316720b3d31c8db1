"""Which miscalibrations a stage is trained on: what decides which errors it learns to see.

Errors that look alike compete for the same evidence: sideways with yaw, height with pitch. A stage trained on
±1°/0.1 m finds the turn in both of them, and next to no shift; drawn much wider in translation than in rotation, it
learns to tell them apart by the ground near the car, where a shift moves the picture most.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibnet.geometry import MiscalibrationRange, sample_miscalibration, scaled
from calibnet.geometry.types import Transform
from calibnet.training.recipe import DrawRecipe


@dataclass(frozen=True)
class Draws:
    """Draws the miscalibrations of one stage: uniform ones, and residuals.

    Attributes:
        range: of the uniform ones.
        recipe: how often and how much they are changed.
        residuals: 4x4 each, what earlier looks left of a miscalibration (`calibnet.training.residuals`); may be none.
        residual_share: share of the draws that are one of them.
    """

    range: MiscalibrationRange
    recipe: DrawRecipe
    residuals: Sequence[Transform] = ()
    residual_share: float = 0.0

    def draw(self, generator: np.random.Generator) -> Transform:
        """A miscalibration, 4x4."""
        if self.residuals and generator.random() < self.residual_share:
            residual = self.residuals[int(generator.integers(len(self.residuals)))]
            return scaled(residual, generator.uniform(*self.recipe.residual_stretch))
        return self.uniform(generator)

    def uniform(self, generator: np.random.Generator) -> Transform:
        """A miscalibration anywhere in the range, sometimes a small one; 4x4."""
        rotation = translation = 1.0
        if generator.random() < self.recipe.eased_share:  # each on its own: small turns come with large shifts, too
            rotation, translation = generator.uniform(self.recipe.eased_least, 1.0, 2)
        eased = MiscalibrationRange(self.range.rotation_deg * rotation, self.range.translation_m * translation)
        return sample_miscalibration(eased, generator)
