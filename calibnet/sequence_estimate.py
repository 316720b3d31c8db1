"""What a drive tells of its one extrinsic."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from calibnet.geometry.se3 import Matrix


@dataclass(frozen=True, eq=False)
class Estimate:
    """The extrinsic that a number of frames agree on.

    Attributes:
        camera_from_lidar: 4x4.
        covariance: ``[6, 6]`` of ``(translation m, rotation rad)``, a perturbation in the camera frame: of networks
            alone as they state it, widened until it explains how far the frames scatter; where edges were
            aligned, with what the networks get wrong in all frames alike, as far as the pictures leave it open.
        frames: that went into it.
    """

    camera_from_lidar: Matrix = field(repr=False)
    covariance: NDArray[np.float64] = field(repr=False)
    frames: int

    @property
    def rotation_deg(self) -> float:
        """Standard deviation of the rotation: the root of the summed variances of its axes."""
        return float(np.degrees(np.sqrt(np.trace(self.covariance[3:, 3:]))))

    @property
    def translation_cm(self) -> float:
        """Standard deviation of the translation, likewise."""
        return float(100 * np.sqrt(np.trace(self.covariance[:3, :3])))


@dataclass(frozen=True, eq=False)
class SequenceEstimate(Estimate):
    """What `Cascade.calibrate_sequence` returns.

    Attributes:
        history: the estimate after more and more frames of the last pass, with the index of the latest in its
            sequence; the last one is the estimate.
        skipped: frames that could not be calibrated in that pass.
        networks: what the networks alone said, where edges were aligned after them; its covariance knows only how far
            frames scatter, not what all of them get wrong. None where nothing was aligned: it would be the estimate.
    """

    history: tuple[tuple[int, Estimate], ...] = field(repr=False, default=())
    skipped: int = 0
    networks: Estimate | None = field(repr=False, default=None)
