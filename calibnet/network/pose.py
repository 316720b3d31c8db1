"""Pose estimation (paper section 3.4): two heads with one interface.

`RegressionHead` is the paper's: translation and unit quaternion, regressed from what the volumes were decoded to.
`GeometricHead` solves a weighted perspective-n-point problem with the displacement field, so that intrinsics and depths
are inputs of the solution instead of being learned for one rig.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from calibnet.geometry import MiscalibrationRange
from calibnet.network.channels import PIXEL_SCALE, inverse_depth
from calibnet.network.config import NetworkConfig
from calibnet.network.displacement import DisplacementField
from calibnet.network.layers import ConvBlock

DEPTH_FLOOR = 0.1
"""Smallest depth, metres, that is divided by: a point may pass the camera while the pose is solved."""


class Pose(NamedTuple):
    """Estimated correction: ``after = correction @ before``.

    Attributes:
        correction: ``[B, 4, 4]`` float32, in the camera frame.
        information: ``[B, 6, 6]`` float32, inverse covariance of ``(translation m, rotation rad)``
            as the head estimates it; None if a head does not.
    """

    correction: Tensor
    information: Tensor | None


def prior_information(range_: MiscalibrationRange) -> Tensor:
    """Inverse variances ``[6]`` of ``(translation m, rotation rad)`` of a uniform miscalibration, float32."""
    return torch.from_numpy(range_.information).diagonal().float()


def skew(vector: Tensor) -> Tensor:
    """``[..., 3]`` to the matrices ``[..., 3, 3]`` of the cross product."""
    x, y, z = vector.unbind(-1)
    zero = torch.zeros_like(x)
    return torch.stack([zero, -z, y, z, zero, -x, -y, x, zero], dim=-1).unflatten(-1, (3, 3))


def rotation_from_vector(vector: Tensor) -> Tensor:
    """Rodrigues: rotation vectors ``[B, 3]`` in radians to ``[B, 3, 3]``; has a gradient at zero."""
    turns = vector.norm(dim=-1)[:, None, None] / math.pi
    cross = skew(vector)
    return (
        torch.eye(3, device=vector.device)
        + torch.sinc(turns) * cross
        + 0.5 * torch.sinc(turns / 2) ** 2 * cross @ cross
    )


def rotation_from_quaternion(quaternion: Tensor) -> Tensor:
    """Quaternions ``[B, 4]`` (w, x, y, z; normalised here) to ``[B, 3, 3]``."""
    w, x, y, z = F.normalize(quaternion, dim=-1).unbind(-1)
    rows = [
        1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
        2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
        2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y),
    ]  # fmt: skip
    return torch.stack(rows, dim=-1).unflatten(-1, (3, 3))


def rigid(rotation: Tensor, translation: Tensor) -> Tensor:
    """``[B, 3, 3]`` and ``[B, 3]`` to ``[B, 4, 4]``."""
    top = torch.cat([rotation, translation[..., None]], dim=-1)
    return torch.cat([top, torch.eye(4, device=top.device, dtype=top.dtype)[3:].expand(len(top), 1, 4)], dim=1)


def project_points(points: Tensor, intrinsics: Tensor) -> Tensor:
    """Camera-frame points ``[B, N, 3]`` to pixels ``[B, N, 2]``; depth is clamped to 0.1 m."""
    homogeneous = points @ intrinsics.transpose(1, 2)
    return homogeneous[..., :2] / points[..., 2:].clamp(min=DEPTH_FLOOR)


class RegressionHead(nn.Module):
    """Translation and unit quaternion from pooled features (the paper's head)."""

    POOLED = (4, 8)

    def __init__(self, config: NetworkConfig, range_: MiscalibrationRange) -> None:
        super().__init__()
        width, norm = config.context_channels, config.normalization
        self.range = range_
        self.reduce = nn.Sequential(ConvBlock(width + 5, width, norm, stride=2), ConvBlock(width, width, norm))
        cells = self.POOLED[0] * self.POOLED[1]
        self.hidden = nn.Sequential(nn.Linear(width * cells, 256), nn.ReLU(inplace=True))
        self.translation, self.quaternion = nn.Linear(256, 3), nn.Linear(256, 4)

    def forward(self, field: DisplacementField, cells: Tensor, intrinsics: Tensor) -> Pose:
        """Estimate the correction from the field and the cells' points ``[B, 3, h, w]``."""
        scaled = [field.displacement / PIXEL_SCALE, field.log_scale, inverse_depth(cells[:, 2:])]
        inputs = torch.cat([field.features, *scaled], dim=1)
        pooled = F.adaptive_avg_pool2d(self.reduce(inputs.contiguous(memory_format=torch.channels_last)), self.POOLED)
        hidden = self.hidden(pooled.flatten(1))
        translation = self.translation(hidden).float() * self.range.translation_m
        half_angle = torch.deg2rad(torch.tensor(self.range.rotation_deg / 2))
        vector = self.quaternion(hidden).float()
        quaternion = torch.cat(
            [torch.ones_like(vector[:, :1]) + 0.1 * vector[:, :1], vector[:, 1:] * half_angle], dim=1
        )
        return Pose(rigid(rotation_from_quaternion(quaternion), translation), None)


class GeometricHead(nn.Module):
    """Weighted Gauss-Newton perspective-n-point over the cells of the finest scale.

    Residuals count in units of the field's own uncertainty, with the IRLS weights of a Charbonnier loss; the range
    the stage was trained for enters as a weak prior, which keeps translation bounded where a scene does not constrain
    it.
    """

    ITERATIONS = 5
    prior: Tensor

    def __init__(self, config: NetworkConfig, range_: MiscalibrationRange) -> None:
        super().__init__()
        self.register_buffer("prior", prior_information(range_), persistent=False)

    def forward(self, field: DisplacementField, cells: Tensor, intrinsics: Tensor) -> Pose:
        """Solve for the correction from the field and the cells' points ``[B, 3, h, w]``."""
        with torch.autocast(cells.device.type, enabled=False):
            flat = cells.flatten(2)
            occupied: Tensor | slice = slice(None)  # cells that are empty in all frames have no weight
            if cells.device.type == "cpu":  # on a GPU, the host would have to wait for their number
                occupied = (flat[:, 2] > 0).any(0)

            def picked(grid: Tensor) -> Tensor:
                return grid.float().flatten(2)[:, :, occupied].transpose(1, 2)

            points = picked(cells)
            target = project_points(points, intrinsics) + picked(field.displacement)
            return self.solve(points, target, picked(field.log_scale).exp(), intrinsics)

    def solve(self, points: Tensor, target: Tensor, scale: Tensor, intrinsics: Tensor) -> Pose:
        """Move ``points [B, N, 3]`` so that they project to ``target [B, N, 2]``.

        Args:
            points: in the camera frame before the correction; those with depth 0 are ignored.
            target: pixels.
            scale: ``[B, N, 2]`` expected absolute error of each target coordinate, pixels.
            intrinsics: ``[B, 3, 3]``.
        """
        # [B, coordinate, N]: the points lie last in memory
        points, target, scale = (part.transpose(1, 2).contiguous() for part in (points, target, scale))
        variance, share = scale**2, (points[:, 2:] > 0) / scale
        rotation = torch.eye(3, device=points.device).expand(len(points), 3, 3)
        translation = torch.zeros(len(points), 3, device=points.device)
        prior = torch.diag(self.prior)
        information = prior.expand(len(points), 6, 6)
        for _ in range(self.ITERATIONS):
            moved = rotation @ points + translation[..., None]
            residual = target - (intrinsics @ moved)[:, :2] / moved[:, 2:].clamp(min=DEPTH_FLOOR)
            weight = share * (variance + residual.detach() ** 2).rsqrt()
            jacobian = projection_jacobian(moved, intrinsics)  # [B, 6, 2, N]
            weighted = (jacobian * weight[:, None]).flatten(2)
            normal = weighted @ jacobian.flatten(2).transpose(1, 2)
            gradient = (weighted @ residual.flatten(1)[..., None])[..., 0]
            gradient = gradient - self.prior * torch.cat([translation, rotation_vector(rotation)], dim=-1)
            information = normal + prior
            # the prior keeps the matrix regular; checking that would make the host wait for a GPU
            step = torch.linalg.solve_ex(information, gradient).result
            turn = rotation_from_vector(step[:, 3:])
            rotation = turn @ rotation
            translation = (turn @ translation[..., None])[..., 0] + step[:, :3]
        return Pose(rigid(rotation, translation), information)


def rotation_vector(rotation: Tensor) -> Tensor:
    """Rotation vector ``[B, 3]`` of small rotations ``[B, 3, 3]``: its length is the sine of their angle.

    It is too short by a sixth of the angle's cube, 2 % at 20 degrees: exact enough for a prior.
    """
    difference = rotation - rotation.transpose(1, 2)
    return 0.5 * torch.stack([difference[:, 2, 1], difference[:, 0, 2], difference[:, 1, 0]], dim=-1)


def projection_jacobian(points: Tensor, intrinsics: Tensor) -> Tensor:
    """Derivative ``[B, 6, 2, N]`` of the pixels by a left perturbation ``(translation, rotation)`` of ``[B, 3, N]``."""
    x, y, depth = points.unbind(1)
    inverse = 1.0 / depth.clamp(min=DEPTH_FLOOR)
    x, y, zero = x * inverse, y * inverse, torch.zeros_like(x)
    xy = x * y
    by_translation = [inverse, zero, zero, inverse, -x * inverse, -y * inverse]  # of (u, v) each
    by_rotation = [-xy, -1 - y * y, 1 + x * x, xy, -y, x]
    focal = intrinsics.diagonal(dim1=1, dim2=2)[:, None, :2, None]
    return torch.stack([*by_translation, *by_rotation], dim=1).unflatten(1, (6, 2)) * focal
