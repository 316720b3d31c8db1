"""Projection, z-buffer and labels of a batch of scans: `calibnet.geometry.projection` and `lidar_input` as tensor code.

A batch of scans is ``[B, N]`` for every coordinate, points that are none of a frame's marked as not there. What is the
nearest of a cell is one minimum over all points at the pixels, and from there over the pixels of the coarser cells.
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
        there: ``[B, N]`` bool: whether it is a point at all.
    """

    x: Tensor
    y: Tensor
    z: Tensor
    intensity: Tensor
    there: Tensor

    def moved(self, transform: Tensor) -> Scans:
        """Mapped by ``[B, 4, 4]``."""
        x, y, z = moved(transform, self.x, self.y, self.z)
        return self._replace(x=x, y=y, z=z)


class Cells(NamedTuple):
    """What the z-buffer sees, as `LidarInput` and `visible_cells` say, for a batch.

    Attributes:
        image: ``[B, 2, H, W]`` sparse depth and intensity.
        cells: per scale ``[B, 3, h, w]``, the nearest point of each cell.
        visible: per scale ``[B, h, w]`` bool.
    """

    image: Tensor
    cells: list[Tensor]
    visible: list[Tensor]


def moved(transform: Tensor, x: Tensor, y: Tensor, z: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """``[B, 4, 4]`` of points ``[B, N]``: not a matrix product, which a GPU may round to ten bits."""
    rows = transform[:, :3, :, None].unbind(1)
    return tuple(x * row[:, 0] + y * row[:, 1] + z * row[:, 2] + row[:, 3] for row in rows)  # type: ignore[return-value]


def pixels(x: Tensor, y: Tensor, depth: Tensor, intrinsics: Tensor) -> tuple[Tensor, Tensor]:
    """Where points ``[B, N]`` of the camera's frame are seen under ``[B, 3, 3]``: u and v, each ``[B, N]``."""
    fx, skew, cx, fy, cy = (
        intrinsics[:, row, column, None] for row, column in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2))
    )
    return (fx * x + skew * y) / depth + cx, fy * y / depth + cy


def rescanned(scans: Scans, scanners: Scanners, generator: torch.Generator) -> Scans:
    """`calibnet.training.augmentation.thin_scan` of a batch."""

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
    """The z-buffer of points of the camera's frame: a key ``[B, H, W]`` int64 a pixel, or `EMPTY`.

    Keys sort by depth. The bits of positive numbers sort as they do; behind them is the point's column, counted from
    the last one, which wins where depths are equal.
    """
    u, v = pixels(points.x, points.y, points.z, intrinsics)
    inside = points.there & (points.z > MINIMUM_DEPTH)
    inside &= (u > -0.5) & (u < width - 0.5) & (v > -0.5) & (v < height - 0.5)
    count = u.shape[1]
    behind = count - 1 - torch.arange(count, device=u.device)
    key = torch.where(inside, points.z.contiguous().view(torch.int32).long() << 32 | behind, EMPTY)
    # those outside change nothing, wherever they are put; all in one place, they would wait for each other
    column, row = (torch.where(inside, (of + 0.5).floor(), 0).long() for of in (u, v))
    pixel = row.clamp(max=height - 1) * width + column.clamp(max=width - 1)
    pixel = torch.where(inside, pixel, behind % (height * width))
    grid = key.new_full((len(key), height * width), EMPTY)
    return grid.scatter_reduce_(1, pixel, key, "amin").unflatten(1, (height, width))


def coarser(keys: Tensor, stride: int) -> Tensor:
    """Keys ``[B, H, W]`` of cells so many times as large: ``[B, H/s, W/s]``."""
    return keys if stride == 1 else keys.unflatten(2, (-1, stride)).unflatten(1, (-1, stride)).amin((2, 4))


def picked(keys: Tensor, *values: Tensor) -> Tensor:
    """Values ``[B, N]`` of the points that keys ``[B, h, w]`` name, 0 in empty cells: ``[B, len(values), h, w]``."""
    occupied = keys != EMPTY
    column = torch.where(occupied, values[0].shape[1] - 1 - (keys & LOW), 0).flatten(1)
    return torch.stack([of.gather(1, column).view(keys.shape) * occupied for of in values], dim=1)


def depth_of(keys: Tensor) -> Tensor:
    """Depth of the nearest point, metres; infinite in empty cells."""
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
    """A batch of scans under extrinsics, and what the camera, truly placed, sees of them.

    Args:
        scans: in their own frames.
        initial: ``[B, 4, 4]`` miscalibrated camera_from_lidar.
        reference: ``[B, 4, 4]`` the true one.
        correction: ``[B, 4, 4]`` from the one to the other.
        intrinsics: ``[B, 3, 3]``.
        shift: ``[B, 2]`` pixels by which the LiDAR image is displaced besides.
        size: height and width of the input, multiples of the coarsest scale.
        scales: pixels a cell, fine to coarse.
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
    """`calibnet.training.samples.visible_cells` of one scale: ``[B, h, w]`` of ``[B, 3, h, w]``.

    ``front`` is the nearest depth ``[B, H/hiding_px, W/hiding_px]`` that the camera, truly placed, sees.
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
