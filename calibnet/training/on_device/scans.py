"""Projection, z-buffer and labels of a batch of scans: `calibnet.geometry.projection` and `lidar_input` as tensor code.

A batch of scans is ``[B, N]`` for every coordinate; scans with fewer points are padded, and a mask says which points
exist. The nearest point of each pixel is one minimum over all points; that of a coarser cell, one over its pixels.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from calibnet.geometry.projection import MINIMUM_DEPTH
from calibnet.network.pose import DEPTH_FLOOR
from calibnet.training.on_device.draws import Scanners
from calibnet.training.recipe import SampleRecipe

EMPTY = torch.iinfo(torch.int64).max
"""A cell without a point."""
LOW = 0xFFFFFFFF


class Scans(NamedTuple):
    """Points in one frame of coordinates, metres.

    Attributes:
        x, y, z: ``[B, N]`` float32.
        intensity: ``[B, N]``, 0..1.
        there: ``[B, N]`` bool: whether the point exists.
    """

    x: Tensor
    y: Tensor
    z: Tensor
    intensity: Tensor
    there: Tensor

    def moved(self, transform: Tensor) -> Scans:
        """The scans mapped by ``[B, 4, 4]``."""
        x, y, z = moved(transform, self.x, self.y, self.z)
        return self._replace(x=x, y=y, z=z)


class Cells(NamedTuple):
    """The result of the z-buffer for a batch: what `LidarInput` and `visible_cells` are for one sample.

    Attributes:
        image: ``[B, 2, H, W]`` sparse depth and intensity.
        cells: per scale ``[B, 3, h, w]``, the nearest point of each cell.
        visible: per scale ``[B, h, w]`` bool.
    """

    image: Tensor
    cells: list[Tensor]
    visible: list[Tensor]


def moved(transform: Tensor, x: Tensor, y: Tensor, z: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Map points ``[B, N]`` by ``[B, 4, 4]``; not by a matrix product, which a GPU may round to ten bits."""
    rows = transform[:, :3, :, None].unbind(1)
    return tuple(x * row[:, 0] + y * row[:, 1] + z * row[:, 2] + row[:, 3] for row in rows)  # type: ignore[return-value]


def pixels(x: Tensor, y: Tensor, depth: Tensor, intrinsics: Tensor) -> tuple[Tensor, Tensor]:
    """Project points ``[B, N]`` of the camera's frame with ``[B, 3, 3]`` to pixels u and v, each ``[B, N]``."""
    fx, skew, cx, fy, cy = (
        intrinsics[:, row, column, None] for row, column in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2))
    )
    return (fx * x + skew * y) / depth + cx, fy * y / depth + cy


def rescanned(scans: Scans, scanners: Scanners, generator: torch.Generator) -> Scans:
    """`calibnet.training.augmentation.thin_scan` for a batch."""

    def of(values: Tensor) -> Tensor:
        return values[:, None]

    x, y, z = (part - of(place) for part, place in zip(scans[:3], scanners.place.unbind(1), strict=True))
    x, y, z = (x * of(row[:, 0]) + y * of(row[:, 1]) + z * of(row[:, 2]) for row in scanners.turn.unbind(1))
    band = (torch.atan2(z, torch.hypot(x, y)) / of(scanners.band_rad)).floor()
    distance = (scans.x.square() + scans.y.square() + scans.z.square()).sqrt()
    size, device = scans.x.shape, scans.x.device
    there = scans.there & (band.remainder(of(scanners.period)) == of(scanners.phase))
    there &= torch.rand(size, generator=generator, device=device) < of(scanners.kept)
    there &= distance < of(scanners.reach_m)
    longer = 1 + of(scanners.range_noise) * torch.randn(size, generator=generator, device=device)
    intensity = (of(scanners.response) * scans.intensity ** of(scanners.gamma)).clamp(0, 1)
    return Scans(scans.x * longer, scans.y * longer, scans.z * longer, intensity, there)


def nearest(points: Scans, intrinsics: Tensor, height: int, width: int) -> Tensor:
    """The z-buffer of points of the camera's frame: a key for every pixel, ``[B, H, W]`` int64, or `EMPTY`.

    Keys sort by depth: the upper half has the bits of the depth, which sort as positive numbers do. The lower half has
    the point's index counted from the end, so that at equal depths the last point wins, as on the CPU.
    """
    u, v = pixels(points.x, points.y, points.z, intrinsics)
    inside = points.there & (points.z > MINIMUM_DEPTH)
    inside &= (u > -0.5) & (u < width - 0.5) & (v > -0.5) & (v < height - 0.5)
    count = u.shape[1]
    behind = count - 1 - torch.arange(count, device=u.device)
    key = torch.where(inside, points.z.contiguous().view(torch.int32).long() << 32 | behind, EMPTY)
    # points outside change nothing wherever they are written; all at one pixel, their writes would be serialised
    column, row = (torch.where(inside, (of + 0.5).floor(), 0).long() for of in (u, v))
    pixel = row.clamp(max=height - 1) * width + column.clamp(max=width - 1)
    pixel = torch.where(inside, pixel, behind % (height * width))
    grid = key.new_full((len(key), height * width), EMPTY)
    return grid.scatter_reduce_(1, pixel, key, "amin").unflatten(1, (height, width))


def coarser(keys: Tensor, stride: int) -> Tensor:
    """Keys of cells of ``stride`` pixels a side: ``[B, H, W]`` to ``[B, H/s, W/s]``."""
    return keys if stride == 1 else keys.unflatten(2, (-1, stride)).unflatten(1, (-1, stride)).amin((2, 4))


def picked(keys: Tensor, *values: Tensor) -> Tensor:
    """Values ``[B, N]`` at the points of keys ``[B, h, w]``, 0 in empty cells: ``[B, len(values), h, w]``."""
    occupied = keys != EMPTY
    column = torch.where(occupied, values[0].shape[1] - 1 - (keys & LOW), 0).flatten(1)
    return torch.stack([of.gather(1, column).view(keys.shape) * occupied for of in values], dim=1)


def depth_of(keys: Tensor) -> Tensor:
    """Depth that keys contain, metres; infinite in empty cells."""
    return torch.where(keys == EMPTY, torch.inf, (keys >> 32).int().view(torch.float32))


def see(
    scans: Scans,
    initial: Tensor,
    reference: Tensor,
    correction: Tensor,
    intrinsics: Tensor,
    shift: Tensor,
    size: tuple[int, int],
    scales: tuple[int, ...],
    recipe: SampleRecipe,
) -> Cells:
    """Project a batch of scans under their initial extrinsics, and find which cells the true camera sees.

    Args:
        scans: scans in the LiDARs' frames.
        initial: ``[B, 4, 4]`` miscalibrated camera_from_lidar.
        reference: ``[B, 4, 4]`` true camera_from_lidar.
        correction: ``[B, 4, 4]``, ``reference = correction @ initial``.
        intrinsics: ``[B, 3, 3]``.
        shift: ``[B, 2]`` pixels by which the LiDAR image is displaced in addition.
        size: height and width of the input, multiples of the coarsest scale.
        scales: sides of the cells in pixels, fine to coarse.
        recipe: when a point counts as hidden.
    """
    displaced = intrinsics.clone()
    displaced[:, :2, 2] += shift
    points = scans.moved(initial)
    keys = nearest(points, displaced, *size)
    image = picked(keys, points.z, points.intensity)
    cells = [picked(coarser(keys, scale), *points[:3]) for scale in scales]
    front = depth_of(coarser(nearest(scans.moved(reference), intrinsics, *size), recipe.hiding_px))
    return Cells(image, cells, [visible(of, correction, intrinsics, front, size, recipe) for of in cells])


def visible(
    cells: Tensor, correction: Tensor, intrinsics: Tensor, front: Tensor, size: tuple[int, int], recipe: SampleRecipe
) -> Tensor:
    """`calibnet.training.samples.visible_cells` for one scale of a batch: ``[B, 3, h, w]`` to ``[B, h, w]`` bool.

    ``front`` is the smallest depth ``[B, H/hiding_px, W/hiding_px]`` that the camera sees under the true extrinsic.
    """
    height, width = size
    flat = cells.flatten(2)
    x, y, z = moved(correction, *flat.unbind(1))
    depth = z.clamp(min=DEPTH_FLOOR)
    u, v = pixels(x, y, depth, intrinsics)
    inside = (flat[:, 2] > 0) & (u > 0) & (u < width - 1) & (v > 0) & (v < height - 1)
    column = ((u + 0.5) / recipe.hiding_px).clamp(0, front.shape[2] - 1).long()
    row = ((v + 0.5) / recipe.hiding_px).clamp(0, front.shape[1] - 1).long()
    hiding = front.flatten(1).gather(1, row * front.shape[2] + column)
    seen = depth < recipe.hidden_factor * hiding + recipe.hidden_margin_m
    return (inside & seen).view(len(cells), *cells.shape[2:])
