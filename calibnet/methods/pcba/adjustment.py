"""The adjustment of extrinsic, intrinsics and landmarks to the tracks of the landmarks and to the planes of the map."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calibnet.geometry import PinholeCamera
from calibnet.geometry.se3 import pose_from_vector
from calibnet.geometry.types import Extrinsic, Floats, Matrix6, Transform
from calibnet.methods.pcba.least_squares import Columns, solve
from calibnet.methods.pcba.planes import Planes
from calibnet.methods.pcba.tracks import Tracks

PIXEL = 0.7
"""Standard deviation of a tracked point, in pixels."""
PLANE_M = 0.04
"""Standard deviation, in metres, of a landmark's distance from its plane: noise of the scanner, and small planes."""
FOCAL, CENTRE_PX = 0.02, 10.0
"""Prior standard deviations of adjusted intrinsics: relative, of focal lengths; in pixels, of the principal point."""
NEAREST_M = 0.5


@dataclass(frozen=True, eq=False)
class Adjusted:
    """The result of an adjustment.

    Attributes:
        camera_from_lidar: 4x4.
        camera: with the adjusted intrinsics.
        landmarks: ``[N, 3]`` metres, in the world frame.
        reprojection: ``[M]`` reprojection error of each observation, in pixels.
        covariance: ``[6, 6]`` of ``(translation m, rotation rad)``, from the residuals.
        cost: sum of the robust losses.
    """

    camera_from_lidar: Extrinsic
    camera: PinholeCamera
    landmarks: Floats = field(repr=False)
    reprojection: Floats = field(repr=False)
    covariance: Matrix6 = field(repr=False)
    cost: float


@dataclass(frozen=True, eq=False)
class Problem:
    """The input of an adjustment.

    Attributes:
        tracks: the observations.
        lidar_from_world: ``[F, 4, 4]`` of the frames.
        camera: the given camera.
        initial: the given ``camera_from_lidar``, 4x4.
        known: ``[6]`` prior standard deviations of ``(translation m, rotation rad)``.
        intrinsics: whether the intrinsics are adjusted too.
    """

    tracks: Tracks
    lidar_from_world: NDArray[np.float64]
    camera: PinholeCamera
    initial: Extrinsic
    known: Floats
    intrinsics: bool = False

    def adjusted_from(
        self, extrinsic: Extrinsic, landmarks: Floats, planes: Planes, rows: NDArray[np.int64], on: NDArray[np.bool_]
    ) -> Adjusted:
        """One adjustment.

        Args:
            extrinsic: initial ``camera_from_lidar``.
            landmarks: ``[N, 3]``, initial landmarks.
            planes: the planes of the map.
            rows: ``[N]``, the plane of each landmark.
            on: ``[N]``, whether a landmark has a plane.
        """
        extra = 4 if self.intrinsics else 0
        head = 6 + extra
        normals, anchors = planes.normals[rows[on]], planes.points[rows[on]]

        def residuals(x: Floats) -> Floats:
            places = x[head:].reshape(-1, 3)
            matrix = adjusted_matrix(self.camera, x[6:head])
            pixel = seen(places, self.tracks, self.lidar_from_world, pose_from_vector(x[:6]) @ extrinsic, matrix)
            apart = ((places[on] - anchors) * normals).sum(axis=1) / PLANE_M
            prior = (x[:6] + offset) / self.known
            inner = x[6:head] / np.array([FOCAL, FOCAL, CENTRE_PX, CENTRE_PX])[:extra]
            return np.concatenate([((pixel - self.tracks.pixel) / PIXEL).ravel(), apart, prior, inner])

        offset = _vector(extrinsic @ np.linalg.inv(self.initial))
        start = np.concatenate([np.zeros(head), landmarks.ravel()])
        found = solve(residuals, start, self._columns(on, head))
        moved = pose_from_vector(found.x[:6]) @ extrinsic
        matrix, places = adjusted_matrix(self.camera, found.x[6:head]), found.x[head:].reshape(-1, 3)
        off = seen(places, self.tracks, self.lidar_from_world, moved, matrix) - self.tracks.pixel
        camera = PinholeCamera(self.camera.width, self.camera.height, matrix)
        covariance = _marginal(found.normal)
        return Adjusted(moved, camera, places, np.linalg.norm(off, axis=1), covariance, found.cost)

    def _columns(self, on: NDArray[np.bool_], head: int) -> Columns:
        """Which residuals each parameter moves, in groups that no residual shares; see `solve`.

        Extrinsic and intrinsics move all pixels and their own prior. A landmark moves its pixels and its plane.
        """
        observations, tied = len(self.tracks.landmark), np.flatnonzero(on)
        pixels = np.arange(2 * observations)
        groups: Columns = []
        for parameter in range(head):
            rows = np.append(pixels, 2 * observations + len(tied) + parameter)
            groups.append([(np.full(len(rows), parameter), rows)])
        rows = np.concatenate([pixels, 2 * observations + np.arange(len(tied))])
        owner = np.concatenate([np.repeat(self.tracks.landmark, 2), tied])
        return [*groups, *([(head + 3 * owner + axis, rows)] for axis in range(3))]


def seen(
    landmarks: Floats, tracks: Tracks, lidar_from_world: NDArray[np.float64], extrinsic: Extrinsic, matrix: Transform
) -> Floats:
    """Projections ``[M, 2]`` of the landmarks in pixels, under an extrinsic and a camera matrix."""
    poses = (extrinsic @ lidar_from_world)[tracks.frame]
    points = np.einsum("mij,mj->mi", poses[:, :3, :3], landmarks[tracks.landmark]) + poses[:, :3, 3]
    depth = np.maximum(points[:, 2:], NEAREST_M)
    return np.asarray((points / depth) @ matrix[:2].T)


def adjusted_matrix(camera: PinholeCamera, change: Floats) -> Floats:
    """The camera matrix after a ``change``: relative of the focal lengths, in pixels of the centre; may be empty."""
    matrix = camera.matrix.astype(np.float64).copy()
    if len(change):
        matrix[0, 0] *= 1 + change[0]
        matrix[1, 1] *= 1 + change[1]
        matrix[:2, 2] += change[2:]
    return matrix


def _vector(change: Transform) -> Floats:
    from calibnet.geometry.se3 import pose_vector

    return np.asarray(pose_vector(change))


def _marginal(normal: Any) -> Matrix6:
    """Marginal covariance of the first six parameters."""
    from scipy.sparse import diags
    from scipy.sparse.linalg import splu

    held = normal + diags(1e-9 * normal.diagonal() + 1e-9)
    covariance = splu(held.tocsc()).solve(np.eye(normal.shape[0], 6))[:6]
    values, axes = np.linalg.eigh((covariance + covariance.T) / 2)
    return np.asarray((axes * np.maximum(values, 1e-10)) @ axes.T)
