"""The record of a run on a drive: the estimate from all its frames, and the looks at each of them."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import NamedTuple, Self

import numpy as np

from calibnet.geometry import invert, transform
from calibnet.geometry.se3 import pose_vector, rotate6, rotated
from calibnet.geometry.types import Extrinsic, Matrix6, Rotation, Vector6
from calibnet.trace.frames import CascadeTrace
from calibnet.verdict import BadFrame, Verdict

CONTRADICTION = 22.5
"""Squared distance of two estimates, relative to their covariances, that one pair in a thousand exceeds by chance."""

LARGEST_SIGMA_CM = 14.0
"""Largest standard deviation of the translation, over all axes, of an extrinsic from motion that is a witness."""


@dataclass(frozen=True, eq=False)
class Estimate:
    """An extrinsic estimated from several frames.

    Attributes:
        camera_from_lidar: the extrinsic, 4x4.
        covariance: ``[6, 6]`` of ``(translation m, rotation rad)``, a perturbation in the camera frame. From networks
            alone, it is the one that they state, scaled to the scatter of the frames; if edges were aligned, it
            includes the common error of the networks as far as the edges leave it open.
        frames: number of frames used.
    """

    camera_from_lidar: Extrinsic = field(repr=False)
    covariance: Matrix6 = field(repr=False)
    frames: int

    @property
    def rotation_deg(self) -> float:
        """Standard deviation of the rotation in degrees: the root of the summed variances of its axes."""
        return float(np.degrees(np.sqrt(np.trace(self.covariance[3:, 3:]))))

    @property
    def translation_cm(self) -> float:
        """Standard deviation of the translation in centimetres, likewise."""
        return float(100 * np.sqrt(np.trace(self.covariance[:3, :3])))

    def offset(self, other: Estimate) -> Vector6:
        """``(translation m, rotation rad)`` from this estimate to another one."""
        return pose_vector(other.camera_from_lidar @ invert(self.camera_from_lidar))

    def distance(self, other: Estimate) -> float:
        """Squared distance from another estimate with independent errors, relative to both covariances.

        It follows the chi-square distribution of six degrees of freedom if both covariances are right.
        """
        offset = self.offset(other)
        return float(offset @ np.linalg.solve(self.covariance + other.covariance, offset))

    def contradicts(self, other: Estimate) -> bool:
        """Whether the two differ more than their covariances explain."""
        return self.distance(other) > CONTRADICTION

    def rotated(self, rotation: Rotation) -> Self:
        """The estimate for a camera turned by ``rotation [3, 3]``."""
        extrinsic = transform(rotation, np.zeros(3)) @ self.camera_from_lidar
        return replace(self, camera_from_lidar=extrinsic, covariance=rotated(self.covariance, rotation))


class LensReading(NamedTuple):
    """What the matches of one look say of the lens, see `calibnet.judging.lens`.

    Attributes:
        cost: cost of the matches, fitted by a pose alone.
        focal_cost, center_cost, radial_cost: cost with another focal length, principal point or radial distortion.
        equidistant_cost: cost with an equidistant fisheye lens.
        focal: logarithm of the fitted focal length relative to that of the calibration.
        right, down: offset of the fitted principal point, in widths of the image.
        radial: the fitted coefficient k1.
    """

    cost: float
    focal_cost: float
    center_cost: float
    radial_cost: float
    equidistant_cost: float
    focal: float
    right: float
    down: float
    radial: float

    @property
    def gain(self) -> float:
        """Logarithm of how much another lens lowers the cost; 0 if none does."""
        bent = min(self.cost, self.focal_cost, self.center_cost, self.radial_cost, self.equidistant_cost)
        return math.log(bent / self.cost) if bent > 0 else 0.0


@dataclass(frozen=True, eq=False)
class MotionEstimate(Estimate):
    """The extrinsic that explains the motion in a drive's images, see `calibnet.motion`.

    Its covariance includes the errors that all pairs of frames have in common. ``frames`` is the number of pairs.

    Attributes:
        tracks: number of pixels that were tracked.
        moved_m: way of the car from frame to frame, summed over the pairs.
        error_px: median over the pairs of how far tracked pixels are from where they should be.
        lens: what fitting another lens as well shows.
    """

    tracks: int
    moved_m: float
    error_px: float
    lens: LensReading

    @property
    def certain(self) -> bool:
        """Whether it is certain enough to be a witness: less certain ones are farther off than they state."""
        return self.translation_cm < LARGEST_SIGMA_CM


@dataclass(frozen=True, eq=False)
class DriveLook:
    """The result of one frame of a drive in the last look, which starts from the same extrinsic for all frames.

    Attributes:
        frame: number of the frame.
        position: position of the frame in the drive.
        offset: ``[6]``, ``(translation m, rotation rad)`` from that extrinsic to the frame's own result.
        information: inverse covariance ``[6, 6]`` of the offset as the network states it, or None.
        match_error_px: the error that the network expects of its matches, in pixels of the stage's camera.
        lens: what its matches say of the lens; None without matches.
        image_error_px: that error in pixels of the frame's image, as results state it.
        camera: name of the camera on its rig; empty for a drive of one camera.
    """

    frame: int
    position: int
    offset: Vector6 = field(repr=False)
    information: Matrix6 | None = field(default=None, repr=False)
    match_error_px: float = math.nan
    lens: LensReading | None = None
    image_error_px: float = math.nan
    camera: str = ""

    def rotated(self, rotation: Rotation) -> DriveLook:
        """The estimate for a camera turned by ``rotation [3, 3]``."""
        offset = rotate6(rotation) @ self.offset
        return replace(self, offset=offset, information=rotated(self.information, rotation))


@dataclass(frozen=True, eq=False)
class DriveEstimate(Estimate):
    """An extrinsic estimated from a drive, the result of `calibnet.cascade.Cascade.calibrate_drive`.

    Attributes:
        history: estimates from more and more frames of the last pass, each with the number of its latest frame; the
            last one is the result, with its covariance before the verdict.
        skipped: frames that could not be read, or calibrated in the last look.
        verdict: verdict on the estimate; None from a method without verdicts.
        networks: estimate of the networks alone, if edges were aligned afterwards; its covariance has the scatter of
            the frames, not their common error. None if nothing was aligned.
        looks: results of the single frames, relative to ``looked_from``.
        looked_from: initial ``camera_from_lidar`` of the last look; None from a method without looks.
        motion: the extrinsic that the motion of the car shows; None if it does not move, or from a method that does
            not use it.
        traces: traces of the frames by their number, from a method that calibrates only whole drives; each goes from
            the drive's initial extrinsic to its estimate, with exhibits of the frame.
    """

    history: tuple[tuple[int, Estimate], ...] = field(repr=False, default=())
    skipped: tuple[BadFrame, ...] = ()
    networks: Estimate | None = field(repr=False, default=None)
    verdict: Verdict | None = None
    looks: tuple[DriveLook, ...] = field(repr=False, default=())
    looked_from: Extrinsic | None = field(repr=False, default=None)
    motion: MotionEstimate | None = field(repr=False, default=None)
    traces: dict[int, CascadeTrace] = field(repr=False, default_factory=dict)

    def rotated(self, rotation: Rotation) -> Self:
        """The estimate for a camera turned by ``rotation [3, 3]``, without the traces of a method of its own."""
        turn = transform(rotation, np.zeros(3))
        return replace(
            super().rotated(rotation),
            history=tuple((frame, so_far.rotated(rotation)) for frame, so_far in self.history),
            networks=None if self.networks is None else self.networks.rotated(rotation),
            verdict=None if self.verdict is None else self.verdict.rotated(rotation),
            looks=tuple(look.rotated(rotation) for look in self.looks),
            looked_from=None if self.looked_from is None else turn @ self.looked_from,
            motion=None if self.motion is None else self.motion.rotated(rotation),
        )

    def judged(self, verdict: Verdict) -> Self:
        """The estimate with its verdict, and the verdict's covariance: one that is certain of the result narrows it."""
        covariance = self.covariance if verdict.covariance is None else verdict.covariance
        return replace(self, verdict=verdict, covariance=covariance)

    def inflated(self, factor: float) -> Self:
        """The estimate with every covariance multiplied by ``factor``."""

        def of(estimate: Estimate) -> Estimate:
            return replace(estimate, covariance=factor * estimate.covariance)

        return replace(
            self,
            covariance=factor * self.covariance,
            history=tuple((frame, of(so_far)) for frame, so_far in self.history),
            networks=None if self.networks is None else of(self.networks),
        )
