"""Miscalibrations: ``initial = delta @ reference``, uniform per axis, in the camera frame."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from calibnet.errors import ConfigError
from calibnet.geometry.se3 import (
    euler_xyz,
    rotation_from_euler_xyz,
    rotation_from_vector,
    rotation_vector,
    transform,
)
from calibnet.geometry.types import Matrix6, Transform

SMALLEST_SIGMA = np.float32(1e-4)
"""Metres or radians: standard deviation of an axis whose range is zero."""


@dataclass(frozen=True, order=True)
class MiscalibrationRange:
    """Largest angle and offset, on every axis, of uniformly drawn miscalibrations.

    Attributes:
        rotation_deg: ± degrees about each axis.
        translation_m: ± metres along each axis.
    """

    rotation_deg: float
    translation_m: float

    @classmethod
    def parse(cls, text: str) -> MiscalibrationRange:
        """Parse ``"20/1.5"``: degrees, a slash, metres."""
        try:
            rotation, translation = (float(part) for part in text.split("/"))
        except ValueError:
            raise ConfigError(f"Range {text!r} is not of the form DEGREES/METRES; write for instance 5/0.5.") from None
        if not (0.0 <= rotation <= 45.0 and 0.0 <= translation <= 10.0):
            raise ConfigError(f"Range {text!r} is not within 45 degrees and 10 metres; give a smaller one.")
        return cls(rotation, translation)

    def contains(self, delta: Transform, margin: float = 1.0) -> bool:
        """Whether a miscalibration, 4x4, is within ``margin`` times this range on every axis, in the camera frame.

        The miscalibration of an extrinsic is ``extrinsic @ invert(truth)``. Its inverse, the correction, may be within
        another range, since its translation is rotated.
        """
        found = range_of(delta)
        return found.rotation_deg <= margin * self.rotation_deg and found.translation_m <= margin * self.translation_m

    def __str__(self) -> str:
        return f"{self.rotation_deg:g}/{self.translation_m:g}"

    @property
    def label(self) -> str:
        """The range for people, for instance ``"±5°/0.5 m"``."""
        return f"±{self.rotation_deg:g}°/{self.translation_m:g} m"

    @property
    def information(self) -> Matrix6:
        """Inverse covariance ``[6, 6]`` of ``(translation m, rotation rad)`` before any measurement.

        The variance of a uniform distribution within ± a is a²/3. Computed in single precision, as in the pose head.
        """
        sigma = np.array([self.translation_m] * 3 + [math.radians(self.rotation_deg)] * 3) / 3**0.5
        return np.diag(1 / np.square(np.maximum(sigma.astype(np.float32), SMALLEST_SIGMA))).astype(np.float64)


RANGES: tuple[MiscalibrationRange, ...] = tuple(
    MiscalibrationRange(*range_) for range_ in ((20, 1.5), (10, 1.0), (5, 0.5), (2, 0.2), (1, 0.1))
)
"""The five ranges of the cascade (paper section 3.5), coarse to fine."""


def is_finest(range_: MiscalibrationRange) -> bool:
    """Whether ``range_`` is that of the last stage of the cascade, the only one whose results are judged."""
    return range_ == RANGES[-1]


def miscalibration(roll_pitch_yaw_deg: ArrayLike, xyz_m: ArrayLike) -> Transform:
    """The ``delta`` of given angles (degrees, about camera z, x, y) and offsets (metres)."""
    roll, pitch, yaw = np.radians(roll_pitch_yaw_deg)
    return transform(rotation_from_euler_xyz([pitch, yaw, roll]), xyz_m)


def sample_miscalibration(range_: MiscalibrationRange, generator: np.random.Generator) -> Transform:
    """Draw one ``delta`` uniformly within ``range_``."""
    angles = generator.uniform(-range_.rotation_deg, range_.rotation_deg, 3)
    return miscalibration(angles, generator.uniform(-range_.translation_m, range_.translation_m, 3))


def scaled(delta: Transform, factor: float) -> Transform:
    """The ``delta`` that turns and moves ``factor`` times as far about the same axes."""
    return transform(rotation_from_vector(factor * rotation_vector(delta[:3, :3])), factor * delta[:3, 3])


def range_of(delta: Transform) -> MiscalibrationRange:
    """The smallest range that contains ``delta``: its largest angle and its largest offset of any axis."""
    angles = np.degrees(np.abs(euler_xyz(delta[:3, :3])))
    return MiscalibrationRange(float(angles.max()), float(np.abs(delta[:3, 3]).max()))


def stages_within(range_: MiscalibrationRange) -> tuple[int, ...]:
    """Numbers (1..5) of the stages that a run starting within ``range_`` goes through.

    The first is the finest whose range covers ``range_`` (``5/0.5`` gives ``3, 4, 5``), so a start
    between two ranges begins with the wider of them; beyond all ranges the run begins with stage 1.
    """
    slack = 1e-6
    covering = [
        number
        for number, stage in enumerate(RANGES, start=1)
        if stage.rotation_deg >= range_.rotation_deg - slack and stage.translation_m >= range_.translation_m - slack
    ]
    return tuple(range(max(covering, default=1), len(RANGES) + 1))
