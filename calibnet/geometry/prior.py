"""The user's prior on an extrinsic: axes that are fixed, and standard deviations of the initial guess.

A car maker may know from drawings where a camera is, and need only its rotation. A prior is an inverse covariance that
is added to that of the measurement, so that the other axes take the values that fit best under it.
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
"""Rotations about the camera's z, x and y axis, and offsets along its x, y and z, as in
`calibnet.geometry.miscalibration`."""
PLACE = {"x": 0, "y": 1, "z": 2, "pitch": 3, "yaw": 4, "roll": 5}
"""Index of each axis in a `Vector6`."""
EXACT = 1e-5
"""Standard deviation, in metres and radians, of an axis that is fixed."""
ITERATIONS = 8
STEP = 1e-6
"""Step of the numeric derivative, in metres and radians."""


@dataclass(frozen=True, eq=False)
class Prior:
    """How well an initial extrinsic is known, axis by axis.

    Attributes:
        information: ``[6]``, inverse variances of offsets x, y, z in m and rotations pitch, yaw, roll in rad; 0 if
            unknown.
        words: the prior in words, for instance ``"known to 2 cm; roll fixed"``; empty if nothing is known.
    """

    information: Floats = field(default_factory=lambda: np.zeros(6), repr=False)
    words: str = ""

    @classmethod
    def of(
        cls, fixed: Sequence[str] = (), translation_m: float | None = None, rotation_rad: float | None = None
    ) -> Prior:
        """The prior that fixes some axes and gives the others standard deviations.

        Args:
            fixed: names of `AXES` that keep their value. Fixed x, y, z keep the camera's position in the LiDAR frame.
            translation_m: standard deviation of the camera's position, along each axis.
            rotation_rad: standard deviation of its rotation, about each axis.

        Raises:
            ConfigError: an axis has another name, all are fixed, or a deviation is not positive.
        """
        for axis in fixed:
            if axis not in AXES:
                raise ConfigError(f"{axis!r} is not an axis; choose from {', '.join(AXES)}.")
        if set(fixed) >= set(AXES):
            raise ConfigError("With all six axes fixed there is nothing to calibrate; leave one free.")
        information, words = np.zeros(6), []
        named = (("x", "y", "z"), translation_m, "m"), (("pitch", "yaw", "roll"), rotation_rad, "rad")
        for axes, sigma, unit in named:
            if sigma is None:
                continue
            if not sigma > 0:
                raise ConfigError(
                    f"A standard deviation of {sigma:g} {unit} is not positive; use --fix for exact axes."
                )
            information[[PLACE[axis] for axis in axes]] = 1 / max(sigma, EXACT) ** 2
            words.append(f"known to {100 * sigma:g} cm" if unit == "m" else f"known to {np.degrees(sigma):.3g}°")
        if fixed:
            information[[PLACE[axis] for axis in fixed]] = EXACT**-2
            words.append(f"{', '.join(axis for axis in AXES if axis in fixed)} fixed")
        return cls(information, "; ".join(words))

    def __bool__(self) -> bool:
        """Whether anything is known."""
        return bool(self.information.any())

    def about(self, initial: Extrinsic) -> PosePrior:
        """The prior about one initial extrinsic, 4x4."""
        return PosePrior(initial, self.information)


@dataclass(frozen=True, eq=False)
class PosePrior:
    """A `Prior` about one extrinsic.

    Attributes:
        initial: centre of the prior, a ``camera_from_lidar``, 4x4.
        information: see `Prior`.
        real_from_camera: ``[3, 3]``, rotation to the user's camera if extrinsics are those of a rotated camera
            (`calibnet.cascade.upright`); the identity by default.
    """

    initial: Extrinsic = field(repr=False)
    information: Floats
    real_from_camera: Rotation = field(default_factory=lambda: np.eye(3), repr=False)

    def turned(self, camera_from_real: Rotation) -> PosePrior:
        """The prior on extrinsics of a rotated camera, ``camera_from_real @ camera_from_lidar``."""
        turn = transform(camera_from_real, np.zeros(3))
        return PosePrior(turn @ self.initial, self.information, self.real_from_camera @ camera_from_real.T)

    def fused(self, measured: Vector6, information: Matrix6, before: Extrinsic) -> tuple[Vector6, Matrix6]:
        """The most likely correction by a measurement and the prior together, and its covariance.

        Args:
            measured: ``[6]``, correction ``(translation m, rotation vector rad)`` of ``before``.
            information: inverse covariance ``[6, 6]`` of it.
            before: ``camera_from_lidar`` to correct, 4x4.
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

    def corrected(self, correction: Transform, information: Matrix6, before: Extrinsic) -> Transform:
        """A measured correction of ``before``, 4x4, fused with the prior.

        Args:
            correction: measured correction, 4x4.
            information: inverse covariance ``[6, 6]`` of it.
            before: ``camera_from_lidar`` to correct, 4x4.
        """
        return pose_from_vector(self.fused(pose_vector(correction), information, before)[0])

    def narrowed(self, covariance: Matrix6, after: Extrinsic) -> Matrix6:
        """The covariance ``[6, 6]`` of a result ``after``, reduced by the prior."""
        return self.fused(np.zeros(6), inverse(covariance), after)[1]

    def _offset(self, correction: Vector6, moved: Transform) -> tuple[Vector6, Floats]:
        """Offset ``[6]`` of the corrected extrinsic from `initial`, in the user's axes, and its derivative."""
        columns = [self._named(correction + step, moved) for step in STEP * np.eye(6)]
        offset = self._named(correction, moved)
        return offset, (np.array(columns) - offset).T / STEP

    def _named(self, correction: Vector6, moved: Transform) -> Vector6:
        """Offsets x, y, z and rotations pitch, yaw, roll of the corrected extrinsic, in the user's axes."""
        back = self.real_from_camera
        delta = pose_from_vector(correction) @ moved
        return np.concatenate([back @ delta[:3, 3], euler_xyz(back @ delta[:3, :3] @ back.T)])


@dataclass(frozen=True)
class Tolerance:
    """Standard deviations to which a camera's pose on its rig is known, the same on every axis.

    Attributes:
        rotation_rad: standard deviation about each axis.
        translation_m: standard deviation along each axis.
    """

    rotation_rad: float
    translation_m: float

    @property
    def covariance(self) -> Matrix6:
        """Covariance ``[6, 6]`` of ``(translation m, rotation rad)``."""
        return np.diag([self.translation_m**2] * 3 + [self.rotation_rad**2] * 3)

    def __str__(self) -> str:
        return f"{np.degrees(self.rotation_rad):.3g}° / {100 * self.translation_m:.3g} cm"


def parse_tolerance(text: str) -> Tolerance:
    """Parse an angle and a length separated by a slash, for instance ``0.5deg/2cm``.

    Raises:
        ConfigError: the text is not of this form.
    """
    angle, stroke, length = text.partition("/")
    if not stroke:
        raise ConfigError(f"{text!r} is not an angle and a length with units; write for instance 0.5deg/2cm.")
    return Tolerance(parse_angle(angle), parse_length(length))


def inverse(matrix: Matrix6) -> Matrix6:
    """The information matrix of a covariance ``[6, 6]``, or the covariance of an information matrix."""
    return np.asarray(np.linalg.inv(matrix), np.float64)


def parse_axes(text: str) -> tuple[str, ...]:
    """Parse names of `AXES`, separated by commas or as the text of a YAML list.

    Raises:
        ConfigError: a name is not that of an axis or is missing, or all six are given.
    """
    names = tuple(re.split(r"[\s'\"]*(?:,|\s)[\s'\"]*", text.lower().strip("[]'\" "))) if text.strip() != "[]" else ()
    Prior.of(names)
    return names


def parse_length(text: str) -> float:
    """Parse a length with its unit, for instance ``2cm``, in metres.

    Raises:
        ConfigError: the text is not of this form.
    """
    return _parse(text, {"mm": 1e-3, "cm": 1e-2, "m": 1.0}, "a length with a unit; write for instance 2cm")


def parse_angle(text: str) -> float:
    """Parse an angle with its unit, for instance ``0.5deg``, in radians.

    Raises:
        ConfigError: the text is not of this form.
    """
    units = {"deg": np.pi / 180, "°": np.pi / 180, "mrad": 1e-3, "rad": 1.0}
    return _parse(text, units, "an angle with a unit; write for instance 0.5deg")


def _parse(text: str, units: dict[str, float], wanted: str) -> float:
    match = re.fullmatch(r"\s*(\d*\.?\d+(?:e-?\d+)?)\s*([a-z°]+)\s*", text.lower())
    if match is None or match[2] not in units or not 0 < float(match[1]) < np.inf:
        raise ConfigError(f"{text!r} is not {wanted}.")
    return float(match[1]) * units[match[2]]
