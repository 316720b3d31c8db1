"""Which miscalibrations a stage is trained on: what decides which errors it learns to see.

Errors that look alike compete for the same evidence: sideways with yaw, height with pitch. A stage trained
on ±1°/0.1 m finds the turn in both of them, and next to no shift; drawn much wider in translation than in rotation, it
learns to tell them apart by the ground near the car, where a shift moves the picture most.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibnet.geometry import RANGES, MiscalibrationRange, sample_miscalibration
from calibnet.geometry.types import Transform


@dataclass(frozen=True)
class Draws:
    """What is drawn for one stage.

    Attributes:
        range: of the miscalibrations drawn uniformly.
        residual_share: share of those drawn instead from what the stages before leave, where that is known.
    """

    range: MiscalibrationRange
    residual_share: float

    EASED_SHARE = 0.3  # of the uniform draws: a stage must also know when to stop
    LEAST = 0.03  # part of the range that an eased draw keeps at least

    def uniform(self, generator: np.random.Generator) -> Transform:
        """A miscalibration anywhere in the range, sometimes a small one; 4x4."""
        rotation = translation = 1.0
        if generator.random() < self.EASED_SHARE:  # each on its own: small turns come with large shifts, too
            rotation, translation = generator.uniform(self.LEAST, 1.0, 2)
        eased = MiscalibrationRange(self.range.rotation_deg * rotation, self.range.translation_m * translation)
        return sample_miscalibration(eased, generator)


WIDER = {
    RANGES[2]: Draws(MiscalibrationRange(5.0, 0.9), 0.4),
    RANGES[3]: Draws(MiscalibrationRange(2.0, 0.5), 0.4),
    RANGES[4]: Draws(MiscalibrationRange(1.5, 0.35), 0.4),
}
"""Stages 3 to 5, which end with what the stages before leave: some three metres for every ten degrees."""


def draws_of(range_: MiscalibrationRange) -> Draws:
    """What is drawn for the stage of ``range_``."""
    return WIDER.get(range_, Draws(range_, 0.7))
