"""The pose of a rig from those of its cameras, and the place of each camera on it.

The frames of a camera measure the pose of that camera. Where the camera's place on the rig is known exactly, this is a
measurement of the rig's pose; where it is known within a tolerance, the tolerance is added to its covariance, and the
camera itself ends between its own measurement and its place on the rig. Without a tolerance the rig is rigid; with an
infinite one, each camera is calibrated on its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from calibnet.datasets.rig import RigCamera
from calibnet.drive.consensus import Consensus
from calibnet.geometry.prior import PosePrior, inverse
from calibnet.geometry.se3 import adjoint, invert, pose_from_vector, pose_vector
from calibnet.geometry.types import Extrinsic, Matrix6, Transform, Vector6


@dataclass(frozen=True, eq=False)
class CameraConsensus:
    """The consensus of one camera of a rig.

    Attributes:
        camera: camera of the rig, with its nominal place.
        camera_from_lidar: extrinsic from its own frames, 4x4.
        covariance: covariance ``[6, 6]`` of the extrinsic, including the error that all its frames share.
    """

    camera: RigCamera
    camera_from_lidar: Extrinsic = field(repr=False)
    covariance: Matrix6 = field(repr=False)

    @classmethod
    def of(cls, camera: RigCamera, consensus: Consensus, common_error: Matrix6) -> CameraConsensus:
        """Make it from a consensus and the covariance of the error that all its frames share."""
        mean, covariance = consensus.agreed()
        return cls(camera, pose_from_vector(mean) @ consensus.before, covariance + common_error)

    def off(self, rig: Extrinsic) -> Vector6:
        """Offset ``[6]`` of the camera from its place on the rig ``rig_from_lidar``, in its own frame."""
        return pose_vector(self.camera_from_lidar @ invert(self.camera.camera_from_rig @ rig))

    def placed(self, rig: Extrinsic, tolerance: Matrix6 | None) -> Transform:
        """The most likely ``camera_from_rig`` within the tolerance."""
        if tolerance is None:
            return self.camera.camera_from_rig
        return pose_from_vector(self._share(tolerance) @ self.off(rig)) @ self.camera.camera_from_rig

    def spread(self, of_rig: Matrix6, tolerance: Matrix6 | None) -> Matrix6:
        """Covariance ``[6, 6]`` of ``camera_from_lidar`` in the camera's frame, including that of the rig's pose."""
        to_camera = adjoint(self.camera.camera_from_rig)
        if tolerance is None:
            return np.asarray(to_camera @ of_rig @ to_camera.T, np.float64)
        by_rig = (np.eye(6) - self._share(tolerance)) @ to_camera
        own = (np.eye(6) - self._share(tolerance)) @ tolerance
        return np.asarray(by_rig @ of_rig @ by_rig.T + own, np.float64)

    def _share(self, tolerance: Matrix6) -> Matrix6:
        """Gain ``[6, 6]``: the share of a camera's offset from its nominal place that is applied."""
        return np.asarray(tolerance @ inverse(tolerance + self.covariance), np.float64)


def rig_correction(
    cameras: Sequence[CameraConsensus],
    rig: Extrinsic,
    pose_prior: PosePrior | None = None,
    tolerance: Matrix6 | None = None,
) -> tuple[Vector6, Matrix6]:
    """The correction of a rig's pose from all its cameras, and its covariance.

    Args:
        cameras: consensus of each camera.
        rig: ``rig_from_lidar`` to correct.
        pose_prior: what is known of the rig's pose beforehand.
        tolerance: covariance ``[6, 6]`` of each camera's pose on the rig, in its own frame; None for a rigid rig.
    """
    information, moment = np.zeros((6, 6)), np.zeros(6)
    for one in cameras:
        camera_from_rig = one.camera.camera_from_rig
        to_camera = adjoint(camera_from_rig)
        spread = one.covariance if tolerance is None else one.covariance + tolerance
        firm = to_camera.T @ inverse(spread) @ to_camera
        of_rig = invert(camera_from_rig) @ one.camera_from_lidar @ invert(rig)
        information, moment = information + firm, moment + firm @ pose_vector(of_rig)
    mean = np.asarray(np.linalg.solve(information, moment), np.float64)
    return (mean, inverse(information)) if pose_prior is None else pose_prior.fused(mean, information, rig)
