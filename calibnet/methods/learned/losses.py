"""Terms of the losses of other papers, in metres and radians."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor

from calibnet.methods.learned.network import MethodLosses
from calibnet.network.batch import NetworkInputs
from calibnet.network.channels import inverse_depth
from calibnet.network.pose import project_points
from calibnet.network.target import rotation_angle, transform_points


def angles(estimate: Tensor, truth: Tensor) -> Tensor:
    """Angles ``[B]`` in radians between the rotations of ``[B, 4, 4]``: the distance of their quaternions."""
    return rotation_angle(estimate[:, :3, :3] @ truth[:, :3, :3].transpose(1, 2))


def smooth_offset(estimate: Tensor, truth: Tensor) -> Tensor:
    """Smooth-L1 distance of the translations, summed over the axes, mean over the batch."""
    return F.smooth_l1_loss(estimate[:, :3, 3], truth[:, :3, 3], reduction="none").sum(-1).mean()


def cloud(cells: Tensor) -> tuple[Tensor, Tensor]:
    """Points ``[B, N, 3]`` of cells ``[B, 3, h, w]``, and a mask ``[B, N]`` of cells that have a point."""
    points = cells.flatten(2).transpose(1, 2)
    return points, points[..., 2] > 0


FARTHEST_M = 100.0
"""Distance at which pairs of points are clipped in a loss, metres."""


def point_distance(estimate: Tensor, truth: Tensor, cells: Tensor) -> Tensor:
    """Mean distance, metres, between the same points under the estimate and under the truth."""
    points, there = cloud(cells)
    distance = (transform_points(estimate, points) - transform_points(truth, points)).square().sum(-1).add(1e-12).sqrt()
    return (distance.clamp(max=FARTHEST_M) * there).sum() / there.sum().clamp(min=1)


def chamfer_distance(estimate: Tensor, truth: Tensor, cells: Tensor) -> Tensor:
    """Mean distance, metres, of each point to the nearest point of the other cloud, in both directions."""
    points, there = cloud(cells)
    ours, true = transform_points(estimate, points), transform_points(truth, points)
    between = torch.cdist(ours, true, compute_mode="donot_use_mm_for_euclid_dist")
    between = between.clamp(max=FARTHEST_M)
    pair = there[:, :, None] & there[:, None]
    between = torch.where(pair, between, torch.full_like(between, FARTHEST_M))
    both = between.amin(1) + between.amin(2)
    return (both * there).sum() / (2 * there.sum().clamp(min=1))


def splat(points: Tensor, there: Tensor, intrinsics: Tensor, size: tuple[int, int], stride: int, above: int) -> Tensor:
    """Inverse depth of points ``[B, N, 3]``, spread over the four nearest of ``size`` cells: ``[B, h, w]``.

    It is differentiable with respect to the points, like the spatial transformer of CalibNet.

    Args:
        points: points in the camera frame, metres.
        there: ``[B, N]``, mask of the points that count.
        intrinsics: ``[B, 3, 3]``.
        size: rows and columns of cells.
        stride: side of a cell, pixels.
        above: rows of cells that were cropped at the top.
    """
    height, width = size
    pixels = project_points(points, intrinsics)
    x, y = ((pixels + 0.5) / stride - 0.5).unbind(-1)
    y = y - above
    seen = there & (points[..., 2] > 0)
    value = torch.where(seen, inverse_depth(points[..., 2]), torch.zeros_like(x))
    left, top = x.detach().floor(), y.detach().floor()
    grid = value.new_zeros(len(points), height * width)
    for down in (0, 1):
        for right in (0, 1):
            column, row = left + right, top + down
            weight = (1 - (x - column).abs()) * (1 - (y - row).abs())
            inside = seen & (column >= 0) & (column < width) & (row >= 0) & (row < height)
            index = (row.clamp(0, height - 1) * width + column.clamp(0, width - 1)).long()
            share = torch.where(inside, weight * value, torch.zeros_like(value))
            grid = grid.scatter_add(1, index, share)
    return grid.view(-1, height, width)


def photometric_error(estimate: Tensor, truth: Tensor, inputs: NetworkInputs, stride: int) -> Tensor:
    """Mean squared difference of the maps of inverse depth under the estimate and under the truth.

    The maps have cells of ``stride`` pixels, and the nearest point of each. Cells that are empty in both do not count.
    """
    cells = inputs.cells[0]
    points, there = cloud(cells)
    size = (cells.shape[2], cells.shape[3])
    above = inputs.image.shape[2] // stride - size[0]
    moved = (transform_points(pose, points) for pose in (estimate, truth))
    maps = [splat(seen, there, inputs.intrinsics, size, stride, above) for seen in moved]
    occupied = (maps[0].detach() > 0) | (maps[1] > 0)
    return ((maps[0] - maps[1]).square() * occupied).sum() / occupied.sum().clamp(min=1)


def method_losses(
    estimate: Tensor,
    truth: Tensor,
    translation: Tensor | None = None,
    rotation: Tensor | None = None,
    points: Tensor | None = None,
    photometric: Tensor | None = None,
) -> MethodLosses:
    """The losses of a method from its terms, with the errors for the progress line."""
    none = estimate.new_zeros(())

    def given(term: Tensor | None) -> Tensor:
        return none if term is None else term

    angle = angles(estimate.detach(), truth)
    offset = (estimate.detach()[:, :3, 3] - truth[:, :3, 3]).norm(dim=-1)
    return MethodLosses(
        translation=given(translation),
        rotation=given(rotation),
        points=given(points),
        photometric=given(photometric),
        rotation_deg=torch.rad2deg(angle).mean(),
        translation_cm=100 * offset.mean(),
    )
