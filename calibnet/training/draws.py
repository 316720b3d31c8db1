"""Draws the miscalibrations that a stage is trained on, which decide what errors it learns to recognise.

Some errors look alike: a sideways shift and a yaw, a change of height and a pitch. A stage trained on ±1° / 0.1 m
explains both by a rotation, and hardly ever finds a translation. If translations are drawn much larger in proportion,
it learns to tell them apart by the ground near the car, where a translation displaces points most.
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
        range: range of the uniform draws.
        recipe: how often and by how much draws are made smaller or larger.
        residuals: 4x4 each, errors that earlier looks left (`calibnet.training.residuals`); may be empty.
        residual_share: share of the draws that are residuals.
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
        """A miscalibration drawn uniformly from the range, and sometimes made smaller; 4x4."""
        rotation = translation = 1.0
        if generator.random() < self.recipe.eased_share:  # each by its own factor: one may be small, the other large
            rotation, translation = generator.uniform(self.recipe.eased_least, 1.0, 2)
        eased = MiscalibrationRange(self.range.rotation_deg * rotation, self.range.translation_m * translation)
        return sample_miscalibration(eased, generator)
