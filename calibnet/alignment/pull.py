"""Points that a map pulls at: what a rigid motion of them gains, and its gradient as force and torque."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from calibnet.geometry import PinholeCamera
from calibnet.geometry.se3 import Matrix, transform_points

NEAREST = 0.1
"""Metres that a point may come to the camera; also those behind it are taken to be there."""


class Sampled(NamedTuple):
    """A map ``[H, W]`` under moved points.

    Attributes:
        values: ``[N]``.
        forces: ``[N, 3]``, derivative of each value by the position of its point, per metre.
        points: ``[N, 3]``, where the points were moved to.
    """

    values: NDArray[np.float64]
    forces: NDArray[np.float64]
    points: NDArray[np.float32]

    def gradient(self, weights: NDArray[np.float64] | float, pivot: NDArray[np.float64]) -> NDArray[np.float64]:
        """Of the values' weighted sum by ``(translation m, rotation rad)``: the sum of forces, and of their torques.

        Args:
            weights: ``[N]``, or one for all.
            pivot: ``[3]``, point that the rotation turns about.
        """
        forces = self.forces * np.reshape(weights, (-1, 1))
        return np.concatenate([forces.sum(0), np.cross(self.points - pivot, forces).sum(0)])


class Map:
    """An image to read between its pixels, with its slopes."""

    def __init__(self, image: NDArray[np.float32], camera: PinholeCamera) -> None:
        """``image [H, W]`` as seen by ``camera``; beyond its border it goes on as it is there."""
        import cv2

        slopes = [cv2.Sobel(image, cv2.CV_32F, dx, dy, ksize=3, scale=1 / 8) for dx, dy in ((1, 0), (0, 1))]
        self.levels = np.ascontiguousarray(np.dstack([image, *slopes]))
        self.camera = camera

    def under(self, points: NDArray[np.float32], correction: Matrix) -> Sampled:
        """Read it where ``points [N, 3]`` of the camera frame are seen after ``correction``, 4x4."""
        import cv2

        focal_u, focal_v = self.camera.matrix[0, 0], self.camera.matrix[1, 1]
        moved = transform_points(correction, points).astype(np.float32, copy=False)
        x, y = moved[:, 0], moved[:, 1]
        inverse = 1 / np.maximum(moved[:, 2], NEAREST)
        u = focal_u * x * inverse + self.camera.matrix[0, 2]
        v = focal_v * y * inverse + self.camera.matrix[1, 2]
        read = cv2.remap(
            self.levels, u.astype(np.float32), v.astype(np.float32), cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
        )
        value, du, dv = read.reshape(-1, 3).T.astype(np.float64)
        du, dv = focal_u * du * inverse, focal_v * dv * inverse
        return Sampled(value, np.stack([du, dv, -(du * x + dv * y) * inverse], axis=1), moved)
