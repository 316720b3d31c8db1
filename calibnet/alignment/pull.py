"""A map that attracts points: its values under a rigid motion of the points, and their gradient as force and torque."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from calibnet.geometry import PinholeCamera
from calibnet.geometry.se3 import transform_points
from calibnet.geometry.types import Floats, Transform, Vector3, Vector6

NEAREST = 0.1
"""Smallest depth, metres; points nearer than this or behind the camera are taken to be there."""
NEIGHBOURS = np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]], np.float32)
"""Offsets, in pixels, at which the map is read: at the point for the value, around it for the slopes."""


class Sampled(NamedTuple):
    """The values of a map ``[H, W]`` at moved points.

    Attributes:
        values: ``[N]``.
        forces: ``[N, 3]``, derivative of each value by the position of its point, per metre.
        points: ``[N, 3]``, where the points were moved to.
    """

    values: Floats
    forces: Floats
    points: NDArray[np.float32]

    def gradient(self, weights: Floats | float, pivot: Vector3) -> Vector6:
        """Gradient ``[6]`` of the values' weighted sum by ``(translation m, rotation rad)``: summed forces and torques.

        Args:
            weights: ``[N]``, or one for all.
            pivot: ``[3]``, point that the rotation turns about.
        """
        forces = self.forces * np.reshape(weights, (-1, 1))
        return np.concatenate([forces.sum(0), np.cross(self.points - pivot, forces).sum(0)])


class Map:
    """An image that can be read between its pixels, with its slopes."""

    def __init__(self, image: NDArray[np.float32], camera: PinholeCamera) -> None:
        """``image [H, W]`` as seen by ``camera``; beyond the border, the values at the border go on."""
        self.image, self.camera = image, camera

    def under(self, points: NDArray[np.float32], correction: Transform) -> Sampled:
        """Read the image where ``points [N, 3]`` of the camera frame are seen after ``correction``, 4x4."""
        (focal_u, skew, centre_u), (_, focal_v, centre_v), _ = self.camera.matrix
        moved = transform_points(correction, points).astype(np.float32, copy=False)
        x, y, z = moved.T
        inverse = 1 / np.maximum(z, NEAREST)
        u, v = (focal_u * x + skew * y) * inverse + centre_u, focal_v * y * inverse + centre_v
        at_u, at_v = ((place + NEIGHBOURS[:, axis, None]).astype(np.float32) for axis, place in enumerate((u, v)))
        read = cv2.remap(self.image, at_u, at_v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        value, right, left, below, above = read.astype(np.float64)
        along_u, along_v = (right - left) / 2, (below - above) / 2
        along_x = focal_u * along_u * inverse
        along_y = (skew * along_u + focal_v * along_v) * inverse
        along_z = np.where(z > NEAREST, -(along_x * x + along_y * y) * inverse, 0.0)
        return Sampled(value, np.stack([along_x, along_y, along_z], axis=1), moved)
