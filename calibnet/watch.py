"""What watching a drive tells: where its frames say that the extrinsic is, over time, and the moves of the mount."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibnet.geometry.types import Extrinsic, Floats, Vector6
from calibnet.verdict import BadFrame

WINDOW = 20
"""Frames of the windowed estimate."""
SMALLEST_DEG, SMALLEST_CM = 0.15, 5.0
"""What is less, in rotation and in translation, is no change of the mount."""


@dataclass(frozen=True, eq=False)
class Change:
    """A move of the mount.

    Attributes:
        frame: index of the first frame after it; of a drift the first frame of all.
        offset: ``[6]``, ``(translation m, rotation rad)`` by which the extrinsic changes, in the camera frame.
        confidence: probability that there is a change, by its own significance among all places where it could be.
        until: index of the last frame of a drift, None for a step.
    """

    frame: int
    offset: Vector6
    confidence: float
    until: int | None = None

    @property
    def rotation_deg(self) -> float:
        """Angle of the move in degrees."""
        return float(np.degrees(np.linalg.norm(self.offset[3:])))

    @property
    def translation_cm(self) -> float:
        """Distance of the move in centimetres."""
        return float(100 * np.linalg.norm(self.offset[:3]))

    @property
    def matters(self) -> bool:
        """Whether it is large enough to be one of the mount."""
        return self.rotation_deg >= SMALLEST_DEG or self.translation_cm >= SMALLEST_CM


@dataclass(frozen=True, eq=False)
class Watch:
    """What the frames of a drive say over time.

    Attributes:
        frames: ``[N]`` their indices.
        offsets: ``[N, 6]`` what each says, ``(translation m, rotation rad)`` from the extrinsic of all.
        windowed: ``[N, 6]`` mean of the frames around each.
        sigma: ``[N, 6]`` standard deviation of that mean.
        changes: in their order.
        smallest: ``[6]`` standard deviations of the difference of two windows of frames: what can be told.
    """

    frames: Floats
    offsets: Floats
    windowed: Floats
    sigma: Floats
    changes: tuple[Change, ...]
    smallest: Floats


@dataclass(frozen=True, eq=False)
class Watched:
    """A drive that was watched.

    Attributes:
        camera_from_lidar: that what frames say is relative to, 4x4; None where none could be found.
        watch: what they say over time; None where nobody can tell.
        reason: why nobody can tell; empty otherwise.
        used: how many frames say something.
        skipped: those that could not be read, or fit nothing.
    """

    camera_from_lidar: Extrinsic | None
    watch: Watch | None
    reason: str
    used: int
    skipped: tuple[BadFrame, ...] = ()
