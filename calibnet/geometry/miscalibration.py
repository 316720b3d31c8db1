"""Miscalibrations: ``initial = delta @ reference``, uniform per axis, in the camera frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibnet.errors import ConfigError
from calibnet.geometry.se3 import Matrix, rotation_from_euler_xyz, transform


@dataclass(frozen=True, order=True)
class MiscalibrationRange:
    """Bounds of a uniform miscalibration: +-degrees and +-metres on every axis."""

    rotation_deg: float
    translation_m: float

    @classmethod
    def parse(cls, text: str) -> MiscalibrationRange:
        """Read ``"20/1.5"``: degrees, a slash, metres."""
        try:
            rotation, translation = (float(part) for part in text.split("/"))
        except ValueError:
            raise ConfigError(f"Range {text!r} is not of the form DEGREES/METRES, for instance 5/0.5.") from None
        if not (0.0 <= rotation <= 45.0 and 0.0 <= translation <= 10.0):
            raise ConfigError(f"Range {text!r} is outside 0..45 degrees and 0..10 metres.")
        return cls(rotation, translation)

    def __str__(self) -> str:
        return f"{self.rotation_deg:g}/{self.translation_m:g}"


RANGES: tuple[MiscalibrationRange, ...] = tuple(
    MiscalibrationRange(*bounds) for bounds in ((20, 1.5), (10, 1.0), (5, 0.5), (2, 0.2), (1, 0.1))
)
"""The five ranges of the cascade (paper section 3.5), coarse to fine."""


def miscalibration(roll_pitch_yaw_deg: Sequence[float], xyz_m: Sequence[float]) -> Matrix:
    """The ``delta`` of given angles (degrees, about camera z, x, y) and offsets (metres)."""
    roll, pitch, yaw = np.radians(roll_pitch_yaw_deg)
    return transform(rotation_from_euler_xyz([pitch, yaw, roll]), xyz_m)


def sample_miscalibration(bounds: MiscalibrationRange, generator: np.random.Generator) -> Matrix:
    """Draw one ``delta`` uniformly within ``bounds``."""
    angles = generator.uniform(-bounds.rotation_deg, bounds.rotation_deg, 3)
    return miscalibration(angles, generator.uniform(-bounds.translation_m, bounds.translation_m, 3))
