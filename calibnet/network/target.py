"""The ground truth of a batch, and the errors of a pose: for training our networks and those of other papers."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from calibnet.network.pose import project_points


class Target(NamedTuple):
    """The ground truth of a batch.

    Attributes:
        correction: ``[B, 4, 4]`` that undoes the miscalibration.
        shift: ``[B, 2]`` pixels ``(x, y)`` by which the LiDAR image is displaced in addition; zero unless the batch
            trains features alone.
        visible: per scale ``[B, h, w]`` bool: the cell's point is seen by the camera (not occluded,
            inside the image).
        of_features: whether the batch trains features alone, from LiDAR images displaced as no pose explains. The host
            needs to know; reading ``shift`` would make it wait for the device.
    """

    correction: Tensor
    shift: Tensor
    visible: list[Tensor]
    of_features: bool = False


def transform_points(correction: Tensor, points: Tensor) -> Tensor:
    """Apply ``[B, 4, 4]`` to ``[B, N, 3]``."""
    return points @ correction[:, :3, :3].transpose(1, 2) + correction[:, None, :3, 3]


def true_displacement(cells: Tensor, correction: Tensor, intrinsics: Tensor) -> Tensor:
    """Pixels ``[B, 2, h, w]`` from where each cell's point is projected to where it belongs."""
    points = cells.flatten(2).transpose(1, 2)
    offset = project_points(transform_points(correction, points), intrinsics) - project_points(points, intrinsics)
    return offset.transpose(1, 2).unflatten(2, cells.shape[2:])


def rotation_angle(rotation: Tensor) -> Tensor:
    """Angle in radians of rotations ``[B, 3, 3]``; has a gradient at zero, unlike the arccos."""
    difference = rotation - rotation.transpose(1, 2)
    sine = torch.stack([difference[:, 2, 1], difference[:, 0, 2], difference[:, 1, 0]], dim=-1)
    sine = 0.5 * (sine.square().sum(-1) + 1e-12).sqrt()
    return torch.atan2(sine, 0.5 * (rotation.diagonal(dim1=1, dim2=2).sum(-1) - 1))
