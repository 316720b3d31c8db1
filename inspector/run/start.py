"""Where the calibration of each frame starts: the dataset's extrinsic, miscalibrated or as it is."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from calibnet.datasets.frame import Frame
from calibnet.geometry import MiscalibrationRange, sample_miscalibration
from calibnet.geometry.miscalibration import range_of, stages_within
from calibnet.geometry.types import Extrinsic


@dataclass(frozen=True)
class Start:
    """Starting extrinsics, the same for the same seed; as text, where they come from.

    Attributes:
        range: what miscalibrations are drawn from, and what decides which stages run.
        seed: of the draw.
        per_frame: draw one for every frame, instead of one for the run (a mount that moved).
        given: a miscalibration to use instead of drawing one.
        as_is: start from the dataset's extrinsic; it is a guess then, and there is no reference.
    """

    range: MiscalibrationRange
    seed: int = 0
    per_frame: bool = False
    given: Extrinsic | None = field(default=None, repr=False)
    as_is: bool = False

    @property
    def stages(self) -> tuple[int, ...]:
        """Numbers of the stages that a run from here goes through."""
        return stages_within(self.range if self.given is None else range_of(self.given))

    def __str__(self) -> str:
        if self.as_is:
            return "from the calibration as it is"
        if self.given is not None:
            return "miscalibrated as given"
        return f"miscalibrated within {self.range}{', anew every frame' if self.per_frame else ''}, seed {self.seed}"

    def initial(self, frame: Frame) -> Extrinsic:
        """The ``camera_from_lidar`` that the cascade starts from on this frame."""
        if self.as_is:
            return frame.camera_from_lidar
        return self._delta(frame) @ frame.camera_from_lidar

    def reference(self, frame: Frame) -> Extrinsic | None:
        """The true ``camera_from_lidar``; None where the dataset's is what is to be corrected."""
        return None if self.as_is else frame.camera_from_lidar

    def _delta(self, frame: Frame) -> Extrinsic:
        if self.given is not None:
            return self.given
        # Seeded by the frame's own number: a selection of frames draws what the whole run would.
        entropy = [self.seed, frame.index] if self.per_frame else [self.seed]
        return sample_miscalibration(self.range, np.random.default_rng(entropy))
