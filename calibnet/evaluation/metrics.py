"""Summary statistics of calibration errors over frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from calibnet.geometry import PoseError
from calibnet.geometry.types import Floats


@dataclass(frozen=True)
class Distribution:
    """Statistics over frames of a non-negative error, in the unit of its field in `Metrics`."""

    mean: float
    median: float
    std: float
    p95: float

    @classmethod
    def of(cls, errors: Floats) -> Distribution:
        """Summarise errors ``[N]``; the standard deviation is that of these frames (divided by N)."""
        return cls(
            mean=float(errors.mean()),
            median=float(np.median(errors)),
            std=float(errors.std()),
            p95=float(np.percentile(errors, 95)),
        )


@dataclass(frozen=True)
class RotationMetrics(Distribution):
    """Angle of ``R_est R_ref^T`` in degrees; per axis the mean absolute value over frames."""

    roll: float
    pitch: float
    yaw: float


@dataclass(frozen=True)
class TranslationMetrics(Distribution):
    """Norm of ``t_est - t_ref`` in centimetres; per axis the mean absolute value over frames."""

    x: float
    y: float
    z: float


@dataclass(frozen=True)
class Metrics:
    """Errors of many frames in one row of a table.

    Attributes:
        rotation_deg: rotation error in degrees.
        translation_cm: translation error in centimetres.
        success_2deg_5cm: fraction of frames below 2 degrees and below 5 cm, 0..1.
        success_1deg_2_5cm: fraction of frames below 1 degree and below 2.5 cm, 0..1.
    """

    rotation_deg: RotationMetrics
    translation_cm: TranslationMetrics
    success_2deg_5cm: float
    success_1deg_2_5cm: float

    @classmethod
    def of(cls, errors: Sequence[PoseError]) -> Metrics:
        """Summarise the errors of frames.

        Raises:
            ValueError: there are no errors.
        """
        if not errors:
            raise ValueError("There are no errors to summarise.")
        # one row per frame: means run along the columns
        rotation = np.array([[e.rotation_deg, e.roll_deg, e.pitch_deg, e.yaw_deg] for e in errors])
        translation = np.array([[e.translation_cm, e.x_cm, e.y_cm, e.z_cm] for e in errors])
        angle, distance = rotation[:, 0], translation[:, 0]
        roll, pitch, yaw = np.abs(rotation[:, 1:]).mean(axis=0)
        x, y, z = np.abs(translation[:, 1:]).mean(axis=0)
        return cls(
            rotation_deg=RotationMetrics(
                **vars(Distribution.of(angle)), roll=float(roll), pitch=float(pitch), yaw=float(yaw)
            ),
            translation_cm=TranslationMetrics(**vars(Distribution.of(distance)), x=float(x), y=float(y), z=float(z)),
            success_2deg_5cm=float(np.mean((angle < 2.0) & (distance < 5.0))),
            success_1deg_2_5cm=float(np.mean((angle < 1.0) & (distance < 2.5))),
        )

    def as_dict(self) -> dict[str, Any]:
        """The content of JSON files; keys end with the unit."""
        return {
            "rotation_deg": dict(vars(self.rotation_deg)),
            "translation_cm": dict(vars(self.translation_cm)),
            "success_2deg_5cm": self.success_2deg_5cm,
            "success_1deg_2.5cm": self.success_1deg_2_5cm,
        }
