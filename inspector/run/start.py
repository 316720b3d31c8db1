"""The initial extrinsic of each frame: the dataset's, miscalibrated or as it is."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from calibnet.datasets.frame import Frame
from calibnet.geometry import MiscalibrationRange, sample_miscalibration
from calibnet.geometry.miscalibration import range_of, stages_within
from calibnet.geometry.types import Extrinsic


@dataclass(frozen=True)
class Start:
    """Initial extrinsics, the same for the same seed; as text, their origin.

    Attributes:
        range: range from which miscalibrations are drawn, and which decides the stages that run.
        seed: seed of the draw.
        per_frame: whether to draw one for every frame instead of one for the run.
        given: miscalibration to use instead of drawing one.
        as_is: whether to start from the dataset's extrinsic, which then is not a reference.
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
        return f"miscalibrated within {self.range}{', anew in every frame' if self.per_frame else ''}, seed {self.seed}"

    def initial(self, frame: Frame) -> Extrinsic:
        """The ``camera_from_lidar`` that the cascade starts from on this frame."""
        if self.as_is:
            return frame.camera_from_lidar
        return self._delta(frame) @ frame.camera_from_lidar

    def reference(self, frame: Frame) -> Extrinsic | None:
        """The true ``camera_from_lidar``; None where the dataset's is the one to correct."""
        return None if self.as_is else frame.camera_from_lidar

    def _delta(self, frame: Frame) -> Extrinsic:
        if self.given is not None:
            return self.given
        # Seeded by the frame's own number: a selection of frames draws what the whole run would.
        entropy = [self.seed, frame.index] if self.per_frame else [self.seed]
        return sample_miscalibration(self.range, np.random.default_rng(entropy))
