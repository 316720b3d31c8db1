"""An extrinsic as six numbers: how far it is rotated and moved from the initial guess."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from calibnet.geometry import euler_xyz, invert, miscalibration
from calibnet.geometry.types import Extrinsic


class Pose(NamedTuple):
    """A change of the guess in the camera frame, as `calibnet.geometry.miscalibration` makes it.

    Attributes:
        roll: degrees about the camera's z (ahead).
        pitch: degrees about x (right).
        yaw: degrees about y (down).
        x: metres to the right.
        y: metres down.
        z: metres ahead.
    """

    roll: float = 0.0
    pitch: float = 0.0
    yaw: float = 0.0
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0

    def applied_to(self, guess: Extrinsic) -> Extrinsic:
        """The ``camera_from_lidar`` after this change of the guess."""
        return miscalibration(self[:3], self[3:]) @ guess

    @classmethod
    def between(cls, extrinsic: Extrinsic, guess: Extrinsic) -> Pose:
        """The change that leads from the guess to the extrinsic."""
        change = extrinsic @ invert(guess)
        pitch, yaw, roll = np.degrees(euler_xyz(change[:3, :3]))
        return cls(float(roll), float(pitch), float(yaw), *map(float, change[:3, 3]))

    def is_finite(self) -> bool:
        """Whether all six numbers are finite and of plausible size."""
        return bool(np.isfinite(self).all() and np.abs(self[:3]).max() <= 180 and np.abs(self[3:]).max() <= 100)
