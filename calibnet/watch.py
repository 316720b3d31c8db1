"""The result of watching a drive: the extrinsic over time, and the moves of the mount."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibnet.geometry.types import Extrinsic, Floats, Vector6
from calibnet.verdict import BadFrame

WINDOW = 20
"""Number of frames of the windowed estimate."""
SMALLEST_DEG, SMALLEST_CM = 0.15, 5.0
"""Smallest rotation and translation that count as a change of the mount."""


@dataclass(frozen=True, eq=False)
class Change:
    """A move of the mount.

    Attributes:
        frame: number of the first frame after the move; for a drift, the first frame of all.
        offset: ``[6]``, ``(translation m, rotation rad)`` by which the extrinsic changes, in the camera frame.
        confidence: probability that there is a change, by its significance among all possible places.
        until: number of the last frame of a drift; None for a step.
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
        """Whether it is large enough to count as a move of the mount."""
        return self.rotation_deg >= SMALLEST_DEG or self.translation_cm >= SMALLEST_CM


@dataclass(frozen=True, eq=False)
class Watch:
    """The extrinsic over time, from the frames of a drive.

    Attributes:
        frames: ``[N]`` numbers of the frames.
        offsets: ``[N, 6]`` offset ``(translation m, rotation rad)`` of each frame's result from that of all.
        windowed: ``[N, 6]`` mean of the frames around each.
        sigma: ``[N, 6]`` standard deviation of that mean.
        changes: the changes, in order.
        smallest: ``[6]`` standard deviations of the difference of two windows of frames, the smallest detectable step.
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
        camera_from_lidar: extrinsic to which offsets are relative, 4x4; None if none was found.
        watch: the extrinsic over time; None if inconclusive.
        reason: why it is inconclusive; empty otherwise.
        used: number of usable frames.
        skipped: frames that could not be read or do not fit.
    """

    camera_from_lidar: Extrinsic | None
    watch: Watch | None
    reason: str
    used: int
    skipped: tuple[BadFrame, ...] = ()
