"""Scores how alike the points are that fall into the same mask of the image, for one extrinsic (the paper's score)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from calibnet.errors import CalibrationError
from calibnet.geometry import PinholeCamera
from calibnet.geometry.se3 import transform_points
from calibnet.geometry.types import Extrinsic, Floats
from calibnet.methods.calib_anything.attributes import MOST_POINTS, Attributes
from calibnet.methods.calib_anything.masks import Labels

Rows = NDArray[np.int64]
NEAREST_M = 0.5
FEWEST = 5
"""Fewest points in a mask that counts."""
FEWEST_POINTS = 200
"""Fewest points in the image at the guess."""
WEIGHTS = {"reflectance": 0.35, "normals": 0.3, "segments": 0.35}
"""Weights of the three attributes in the score of a mask. The paper does not give them. Reflectance and segments change
at the edges of objects, normals also within them."""


class Consistency:
    """The score of extrinsics on one frame: 0 if points in a mask are no more alike than any, 1 if they are equal.

    It is the mean over the points that are in the image at the guess; points that leave the image or fall into a mask
    with few others count 0. The paper takes the mean over masks, but that is largest for a camera turned towards
    nothing but road, whose points are all alike.
    """

    def __init__(self, labels: Labels, camera: PinholeCamera, scan: Attributes, guess: Extrinsic) -> None:
        """Score ``scan`` in the masks ``labels`` of ``camera``'s image, around a guess, ``camera_from_lidar``.

        Raises:
            CalibrationError: too few points are in the image at the guess.
        """
        self.labels, self.camera = labels, camera
        self.masks, self.segments = int(labels.max()) + 1, int(scan.segments.max()) + 1
        self.scan = scan
        self.scan = scan.only(self._inside(guess)[0])
        if len(self.scan.points) < FEWEST_POINTS:
            raise CalibrationError(
                f"Only {len(self.scan.points)} points of {MOST_POINTS} are inside the image under the guess, too few "
                "for "
                "masks; give a better guess."
            )
        self.columns = np.concatenate(
            [np.stack([self.scan.reflectance, self.scan.reflectance**2]), self.scan.normals.T]
        )
        self.weights = dict(WEIGHTS) if np.ptp(self.scan.reflectance) > 0 else {**WEIGHTS, "reflectance": 0.0}
        self.variance = max(float(self.scan.reflectance.var()), 1e-9)
        everything = np.zeros(len(self.scan.points), np.int64)
        self.chance = self._parts(np.arange(len(everything)), everything, 1)

    def __call__(self, camera_from_lidar: Extrinsic) -> float:
        """The score of an extrinsic."""
        scores, counts = self.of_masks(camera_from_lidar)
        told = counts >= FEWEST
        return float(scores[told] @ counts[told]) / len(self.scan.points)

    def of_masks(self, camera_from_lidar: Extrinsic) -> tuple[Floats, Floats]:
        """The score of every mask, and the number of points in it."""
        seen, pixels = self._inside(camera_from_lidar)
        mask = self.labels[pixels[1], pixels[0]]
        seen, mask = seen[mask >= 0], mask[mask >= 0]
        parts = self._parts(seen, mask, max(self.masks, 1))
        total = np.zeros(max(self.masks, 1))
        for name, weight in self.weights.items():
            chance = self.chance[name][0]
            total += weight * (parts[name] - chance) / max(1 - chance, 1e-9)
        return total / sum(self.weights.values()), np.bincount(mask, minlength=len(total)).astype(np.float64)

    def _parts(self, seen: Rows, mask: Rows, masks: int) -> dict[str, Floats]:
        """Similarity of the points of every mask in each attribute, as the mean over all pairs of points."""
        n = np.maximum(np.bincount(mask, minlength=masks).astype(np.float64), 1)
        pairs = np.maximum(n * (n - 1), 1)
        first, second, x, y, z = (np.bincount(mask, column[seen], minlength=masks) for column in self.columns)
        apart = np.maximum(second - first**2 / n, 0.0) / np.maximum(n - 1, 1)
        together = np.bincount(mask * self.segments + self.scan.segments[seen], minlength=masks * self.segments)
        same = np.square(together.reshape(masks, self.segments).astype(np.float64)).sum(axis=1)
        return {
            "reflectance": 1 - apart / self.variance,
            "normals": (x**2 + y**2 + z**2 - n) / pairs,
            "segments": (same - n) / pairs,
        }

    def _inside(self, camera_from_lidar: Extrinsic) -> tuple[Rows, Rows]:
        """Rows of the points in the image, and their pixels ``[2, N]``, ``(u, v)``."""
        x, y, z = transform_points(camera_from_lidar, self.scan.points).T
        ahead = np.flatnonzero(z > NEAREST_M)
        (focal_u, skew, centre_u), (_, focal_v, centre_v), _ = self.camera.matrix
        u = np.rint((focal_u * x[ahead] + skew * y[ahead]) / z[ahead] + centre_u)
        v = np.rint(focal_v * y[ahead] / z[ahead] + centre_v)
        inside = (u >= 0) & (u < self.camera.width) & (v >= 0) & (v < self.camera.height)
        return ahead[inside], np.stack([u[inside], v[inside]]).astype(np.int64)
