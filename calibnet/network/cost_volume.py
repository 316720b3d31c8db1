"""Multi-scale cost volumes (paper section 3.2): group-wise correlation and concatenation.

Stereo searches one-sided horizontal disparities. A miscalibration moves points along both axes
and in both directions, so each LiDAR cell is compared with a window of ``(2r+1) x (2r+1)`` image
cells around it, and a volume is ``[B, Dy, Dx, h, w, C]``.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from calibnet.network.config import NetworkConfig
from calibnet.network.convolution import Conv2d
from calibnet.network.features import Features

LOGIT_SCALE = 14.0
"""Cosines of unit-norm features become logits times this."""

RUN = 16
"""Length of the runs, in cells, into which `correlate` divides a row."""


def search_region(image: Tensor, height: int, radius: int) -> Tensor:
    """The part of an image that the windows of its lowest ``height`` rows cover: ``[B, C, height + 2r, w + 2r]``.

    It is zero outside the image; above those rows it has the image's own rows, where there are any.
    """
    return F.pad(image, [radius] * 4)[:, :, image.shape[2] - height :]


def correlate(lidar: Tensor, image: Tensor, radius: int, groups: int) -> Tensor:
    """Group-wise correlation of every LiDAR cell with the window of image cells around it.

    Short runs of LiDAR cells are multiplied by the image cells around them in one batched matrix product, and the band
    around its diagonal is the result. A loop over shifts takes several times as long on a CPU, and the product of all
    pairs of cells many times the memory.

    Args:
        lidar: ``[B, C, h, w]``, features of the whole image's height or of its lowest rows (`batch.Cut`).
        image: ``[B, C, H, w]``, ``H >= h``.
        radius: of the window, in cells.
        groups: number of channel groups, each summed on its own.

    Returns:
        ``[B, Dy, Dx, h, w, groups]`` with zeros where the window leaves the image.
    """
    batch, _, height, width = lidar.shape
    window, around, runs = 2 * radius + 1, RUN + 2 * radius, -(-width // RUN)
    beyond = [0, runs * RUN - width]

    def grouped(features: Tensor) -> Tensor:
        return F.pad(features, beyond).unflatten(1, (groups, -1)).movedim(2, -1)  # [B, G, h, w, C/G]: as in memory

    rows = grouped(search_region(image, height, radius)).unfold(2, window, 1).unfold(3, around, RUN).movedim(4, -1)
    cells = grouped(lidar).unflatten(3, (runs, RUN))
    products = cells @ rows.flatten(4, 5).transpose(-1, -2)  # [B, G, h, runs, R, Dy * (R + 2r)]
    b, g, y, run, x, _ = products.stride()
    # the window of the next cell of a run begins one image cell farther to the right
    band = products.as_strided((batch, groups, window, window, height, runs, RUN), (b, g, around, 1, y, run, x + 1))
    return band.flatten(5)[..., :width].movedim(1, -1)


def concatenation_volume(lidar: Tensor, image: Tensor, radius: int) -> tuple[Tensor, Tensor]:
    """Features ``[B, C, h, w]`` of each LiDAR cell and of its window in the image, ``[B, C, Dy, Dx, h, w]`` each."""
    window = 2 * radius + 1
    moved = search_region(image, lidar.shape[2], radius).contiguous().unfold(2, window, 1).unfold(3, window, 1)
    moved = moved.permute(0, 1, 4, 5, 2, 3)
    return lidar.contiguous()[:, :, None, None].expand_as(moved), moved


def group_cosines(lidar: Tensor, image: Tensor, radius: int, groups: int) -> Tensor:
    """Share of each channel group in the cosine of features ``[B, C, h, w]``: ``[B, Dy, Dx, h, w, groups]``."""
    return correlate(F.normalize(lidar, dim=1), F.normalize(image, dim=1), radius, groups)


def total(shares: Tensor) -> Tensor:
    """The cosine ``[B, D, h, w]``, which is the sum of the groups' shares, as the whole vectors have unit norm."""
    return (shares.sum(-1) if shares.shape[-1] > 1 else shares[..., 0]).flatten(1, 2)


def cosine(lidar: Tensor, image: Tensor, radius: int) -> Tensor:
    """Cosine ``[B, D, h, w]`` of every LiDAR cell with its window, from features ``[B, C, h, w]``."""
    return total(group_cosines(lidar, image, radius, groups=1))


class Volume(NamedTuple):
    """The cost volume of one scale.

    Attributes:
        channels: ``[B, Dy, Dx, h, w, G + 2Cc]``, of every displacement of every LiDAR cell.
        score: ``[B, D, h, w]``, the cosine of the two features, to which the hourglass adds.
    """

    channels: Tensor
    score: Tensor


class CostVolume(nn.Module):
    """Makes the cost volume of one scale."""

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        self.radius, self.groups = config.radius, config.groups
        self.reduce_lidar = Conv2d(config.feature_channels, config.concat_channels, 1)
        self.reduce_image = Conv2d(config.feature_channels, config.concat_channels, 1)

    def forward(self, lidar: Tensor, image: Tensor) -> Volume:
        """Compare features ``[B, C, h, w]`` of both branches."""
        shares = group_cosines(lidar, image, self.radius, self.groups)
        fixed, moved = concatenation_volume(self.reduce_lidar(lidar), self.reduce_image(image), self.radius)
        # a group's share of the cosine is about 1/G: scaled so that all channels start alike
        scaled = shares * self.groups if self.groups > 1 else shares
        # joined with channels first, then moved last: four times as fast as interleaving a few channels at a time
        parts = [scaled.movedim(-1, 1), fixed.to(shares.dtype), moved.to(shares.dtype)]
        return Volume(torch.cat(parts, dim=1).movedim(1, -1).contiguous(), total(shares))


class CostVolumes(nn.ModuleList):
    """Makes the cost volumes of all scales."""

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__(CostVolume(config) for _ in config.volume_scales)

    def forward(self, features: Features) -> list[Volume]:
        """Compare the features of both branches at every scale, fine to coarse."""
        return [build(lidar, image) for build, lidar, image in zip(self, *features, strict=True)]
