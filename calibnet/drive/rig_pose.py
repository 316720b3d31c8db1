"""The pose of a rig that its cameras agree on, and where each camera is on it.

A camera's frames say where that camera is. If it is known exactly relative to the rig, that is a measurement of the
rig's pose; if it is known within a tolerance, it is one that is less sure by as much, and the camera itself ends
between what it says and where the rig wants it. The tolerance 0 is the rigid rig, an endless one each camera on its
own.
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
class Said:
    """What the frames of one camera say together.

    Attributes:
        camera: of the rig, where it is expected on it.
        camera_from_lidar: 4x4, where they say that it is.
        covariance: ``[6, 6]`` of that, with what the networks get wrong in all its frames alike.
    """

    camera: RigCamera
    camera_from_lidar: Extrinsic = field(repr=False)
    covariance: Matrix6 = field(repr=False)

    @classmethod
    def of(cls, camera: RigCamera, consensus: Consensus, common_error: Matrix6) -> Said:
        """What frames agree on; ``common_error`` is the covariance of what is wrong in all of them alike."""
        mean, covariance = consensus.agreed()
        return cls(camera, pose_from_vector(mean) @ consensus.before, covariance + common_error)

    def off(self, rig: Extrinsic) -> Vector6:
        """How far the camera is from where it is expected on the rig ``rig_from_lidar``, in its own frame."""
        return pose_vector(self.camera_from_lidar @ invert(self.camera.camera_from_rig @ rig))

    def placed(self, rig: Extrinsic, tolerance: Matrix6 | None) -> Transform:
        """``camera_from_rig``, as it is most likely within the tolerance."""
        if tolerance is None:
            return self.camera.camera_from_rig
        return pose_from_vector(self._share(tolerance) @ self.off(rig)) @ self.camera.camera_from_rig

    def spread(self, of_rig: Matrix6, tolerance: Matrix6 | None) -> Matrix6:
        """Covariance ``[6, 6]`` of ``camera_from_lidar``, in the camera's frame, with that of the rig's pose."""
        to_camera = adjoint(self.camera.camera_from_rig)
        if tolerance is None:
            return np.asarray(to_camera @ of_rig @ to_camera.T, np.float64)
        by_rig = (np.eye(6) - self._share(tolerance)) @ to_camera
        own = (np.eye(6) - self._share(tolerance)) @ tolerance
        return np.asarray(by_rig @ of_rig @ by_rig.T + own, np.float64)

    def _share(self, tolerance: Matrix6) -> Matrix6:
        """Gain ``[6, 6]``: the share of a camera's offset from its place on the rig by which it is moved."""
        return np.asarray(tolerance @ inverse(tolerance + self.covariance), np.float64)


def joined(
    said: Sequence[Said], rig: Extrinsic, pose_prior: PosePrior | None = None, tolerance: Matrix6 | None = None
) -> tuple[Vector6, Matrix6]:
    """The correction of a rig's pose that its cameras agree on, and its covariance.

    Args:
        said: by the frames of each camera.
        rig: ``rig_from_lidar`` that is corrected.
        pose_prior: what is known of the rig's pose beforehand.
        tolerance: covariance ``[6, 6]`` of each camera's pose on the rig, in its own frame; None for none at all.
    """
    information, moment = np.zeros((6, 6)), np.zeros(6)
    for one in said:
        camera_from_rig = one.camera.camera_from_rig
        to_camera = adjoint(camera_from_rig)
        spread = one.covariance if tolerance is None else one.covariance + tolerance
        firm = to_camera.T @ inverse(spread) @ to_camera
        of_rig = invert(camera_from_rig) @ one.camera_from_lidar @ invert(rig)
        information, moment = information + firm, moment + firm @ pose_vector(of_rig)
    mean = np.asarray(np.linalg.solve(information, moment), np.float64)
    return (mean, inverse(information)) if pose_prior is None else pose_prior.fused(mean, information, rig)
