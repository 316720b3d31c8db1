"""What is known of an extrinsic before anything is measured: axes that are fixed, and how good the start is.

A car maker knows from drawings where a camera is, and wants its rotation; whoever turns a mount by hand knows the rest.
It enters as information, as of one more measurement, so that the other axes are solved as they are best under it.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from calibnet.errors import ConfigError
from calibnet.geometry.se3 import euler_xyz, invert, pose_from_vector, pose_vector, transform
from calibnet.geometry.types import Extrinsic, Floats, Matrix6, Rotation, Transform, Vector6

AXES = ("roll", "pitch", "yaw", "x", "y", "z")
"""As `calibnet.geometry.miscalibration` has them: about the camera's z, x and y axis, and along its x, y and z."""
PLACE = {"x": 0, "y": 1, "z": 2, "pitch": 3, "yaw": 4, "roll": 5}
"""Of each in a `Vector6`."""
EXACT = 1e-5
"""Standard deviation, in metres and radians, of what is fixed."""
ITERATIONS = 8
STEP = 1e-6
"""Of the numeric derivative."""


@dataclass(frozen=True, eq=False)
class Known:
    """What is known of extrinsics, relative to the one that a calibration starts from.

    Attributes:
        information: ``[6]``, inverse variances of offsets x, y, z in m and turns pitch, yaw, roll in rad.
        words: how the user said it, for titles; empty for nothing.
    """

    information: Floats = field(default_factory=lambda: np.zeros(6), repr=False)
    words: str = ""

    @classmethod
    def of(
        cls, fixed: Sequence[str] = (), translation_m: float | None = None, rotation_rad: float | None = None
    ) -> Known:
        """What is known.

        Args:
            fixed: names of `AXES` that keep their value. Fixed x, y, z keep the camera's place as seen from the LiDAR.
            translation_m: standard deviation of the camera's place, on each axis.
            rotation_rad: standard deviation of the turn, about each axis.

        Raises:
            ConfigError: an axis has another name, all are fixed, or a deviation is not above 0.
        """
        for axis in fixed:
            if axis not in AXES:
                raise ConfigError(f"{axis!r} is no axis that can be fixed; choose from {', '.join(AXES)}.")
        if set(fixed) >= set(AXES):
            raise ConfigError("With all six axes fixed there is nothing to calibrate; leave one free.")
        information, words = np.zeros(6), []
        named = (("x", "y", "z"), translation_m, "m"), (("pitch", "yaw", "roll"), rotation_rad, "rad")
        for axes, sigma, unit in named:
            if sigma is None:
                continue
            if not sigma > 0:
                raise ConfigError(
                    f"A standard deviation of {sigma:g} {unit} is not above 0; use --fix for what is exact."
                )
            information[[PLACE[axis] for axis in axes]] = 1 / max(sigma, EXACT) ** 2
            words.append(f"known to {100 * sigma:g} cm" if unit == "m" else f"known to {np.degrees(sigma):.3g}°")
        if fixed:
            information[[PLACE[axis] for axis in fixed]] = EXACT**-2
            words.append(f"{', '.join(axis for axis in AXES if axis in fixed)} fixed")
        return cls(information, "; ".join(words))

    def __bool__(self) -> bool:
        """Whether anything is."""
        return bool(self.information.any())

    def about(self, initial: Extrinsic) -> Held:
        """It, of the extrinsic that a calibration starts from."""
        return Held(initial, self.information)


@dataclass(frozen=True, eq=False)
class Held:
    """What is known of one extrinsic.

    Attributes:
        initial: ``camera_from_lidar`` that it is known of, 4x4.
        information: as of `Known`.
        real_from_camera: ``[3, 3]``, where the extrinsics are of a camera that is turned against the one whose axes are
            meant; not turned by default.
    """

    initial: Extrinsic = field(repr=False)
    information: Floats
    real_from_camera: Rotation = field(default_factory=lambda: np.eye(3), repr=False)

    def turned(self, camera_from_real: Rotation) -> Held:
        """It, of extrinsics of a camera that is turned: ``camera_from_real @ camera_from_lidar``."""
        turn = transform(camera_from_real, np.zeros(3))
        return Held(turn @ self.initial, self.information, self.real_from_camera @ camera_from_real.T)

    def fused(self, measured: Vector6, information: Matrix6, before: Extrinsic) -> tuple[Vector6, Matrix6]:
        """The correction that a measurement and what is known agree on, and its covariance.

        Args:
            measured: ``[6]``, correction ``(translation m, rotation vector rad)`` of ``before``.
            information: ``[6, 6]`` of it.
            before: ``camera_from_lidar`` that is corrected, 4x4.
        """
        moved = before @ invert(self.initial)
        correction = np.asarray(measured, np.float64)
        normal = information
        for _ in range(ITERATIONS):
            offset, jacobian = self._offset(correction, moved)
            weighted = jacobian.T * self.information
            normal = information + weighted @ jacobian
            gradient = information @ (measured - correction) - weighted @ offset
            step = np.linalg.solve(normal, gradient)
            correction = correction + step
            if np.abs(step).max() < 1e-10:
                break
        return correction, inverse(normal)

    def corrected(self, correction: Transform, information: Matrix6 | None, before: Extrinsic) -> Transform:
        """A correction of ``before``, 4x4, as `fused` leaves it; without information its free axes are left alone."""
        firm = np.eye(6) if information is None else information
        return pose_from_vector(self.fused(pose_vector(correction), firm, before)[0])

    def narrowed(self, covariance: Matrix6, after: Extrinsic) -> Matrix6:
        """The covariance ``[6, 6]`` of ``after``, a perturbation in its camera frame, with what is known."""
        return self.fused(np.zeros(6), inverse(covariance), after)[1]

    def _offset(self, correction: Vector6, moved: Transform) -> tuple[Vector6, Floats]:
        """How far the corrected extrinsic lies from the one that is known, and the derivative ``[6, 6]``."""
        columns = [self._named(correction + step, moved) for step in STEP * np.eye(6)]
        offset = self._named(correction, moved)
        return offset, (np.array(columns) - offset).T / STEP

    def _named(self, correction: Vector6, moved: Transform) -> Vector6:
        """Offsets x, y, z and turns pitch, yaw, roll of the corrected extrinsic, in the real camera's axes."""
        back = self.real_from_camera
        delta = pose_from_vector(correction) @ moved
        return np.concatenate([back @ delta[:3, 3], euler_xyz(back @ delta[:3, :3] @ back.T)])


@dataclass(frozen=True)
class Tolerance:
    """How well a camera's place on its rig is known, one standard deviation an axis.

    Attributes:
        rotation_rad: about each axis.
        translation_m: along each axis.
    """

    rotation_rad: float
    translation_m: float

    @property
    def covariance(self) -> Matrix6:
        """``[6, 6]`` of ``(translation m, rotation rad)``."""
        return np.diag([self.translation_m**2] * 3 + [self.rotation_rad**2] * 3)

    def __str__(self) -> str:
        return f"{np.degrees(self.rotation_rad):.3g}° / {100 * self.translation_m:.3g} cm"


def parse_tolerance(text: str) -> Tolerance:
    """An angle and a length with a stroke between them, for instance ``0.5deg/2cm``.

    Raises:
        ConfigError: it is none.
    """
    angle, stroke, length = text.partition("/")
    if not stroke:
        raise ConfigError(f"{text!r} is not an angle and a length with their units, for instance 0.5deg/2cm.")
    return Tolerance(parse_angle(angle), parse_length(length))


def inverse(matrix: Matrix6) -> Matrix6:
    """An information of a covariance, and the other way round."""
    return np.asarray(np.linalg.inv(matrix), np.float64)


def parse_axes(text: str) -> tuple[str, ...]:
    """Names of `AXES` with commas between them; a list of YAML as text is one, too.

    Raises:
        ConfigError: one is no such name, or all six are there.
    """
    names = tuple(name for name in re.split(r"[\s,\[\]'\"]+", text.lower()) if name)
    Known.of(names)
    return names


def parse_length(text: str) -> float:
    """Metres of a length with its unit, for instance ``2cm``.

    Raises:
        ConfigError: it is none.
    """
    return _parse(text, {"mm": 1e-3, "cm": 1e-2, "m": 1.0}, "a length with its unit, for instance 2cm")


def parse_angle(text: str) -> float:
    """Radians of an angle with its unit, for instance ``0.5deg``.

    Raises:
        ConfigError: it is none.
    """
    units = {"deg": np.pi / 180, "°": np.pi / 180, "mrad": 1e-3, "rad": 1.0}
    return _parse(text, units, "an angle with its unit, for instance 0.5deg")


def _parse(text: str, units: dict[str, float], wanted: str) -> float:
    match = re.fullmatch(r"\s*(\d*\.?\d+(?:e-?\d+)?)\s*([a-z°]+)\s*", text.lower())
    if match is None or match[2] not in units or not 0 < float(match[1]) < np.inf:
        raise ConfigError(f"{text!r} is not {wanted}.")
    return float(match[1]) * units[match[2]]
