"""Multi-scale cost volumes (paper section 3.2): group-wise correlation and concatenation.

Stereo searches one-sided horizontal disparities. A miscalibration moves points along both axes
and in both directions, so each LiDAR cell is compared with a window of ``(2r+1) x (2r+1)`` image
cells around it; the window, row by row, becomes the depth ``D`` of the 3-D convolutions.
"""

from __future__ import annotations

from functools import lru_cache

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from calibnet.network.config import NetworkConfig

TEMPERATURE = 14.0
"""Cosines of unit-norm features become logits times this."""


def surroundings(image: Tensor, height: int, radius: int) -> Tensor:
    """What the windows of the lowest ``height`` rows see of an image: ``[B, C, height + 2r, w + 2r]``.

    Zeros beside it; above, the rows that are there.
    """
    return F.pad(image, [radius] * 4)[:, :, image.shape[2] - height :]


def correlate(lidar: Tensor, image: Tensor, radius: int, groups: int) -> Tensor:
    """Group-wise correlation of every LiDAR cell with the window of image cells around it.

    One batched matrix product of each row of LiDAR cells with the image rows of its window, and a
    gather of the band around the diagonal; a loop of shifted products takes four times as long on a
    CPU, and the product of all pairs of cells three times the memory.

    Args:
        lidar: ``[B, C, h, w]``, of all of the image or of its lowest rows, where the scan is.
        image: ``[B, C, H, w]``, ``H >= h``.
        radius: of the window, in cells.
        groups: number of channel groups, each summed on its own.

    Returns:
        ``[B, D, h, w, groups]`` with zeros where the window leaves the image.
    """
    batch, channels, height, width = lidar.shape
    window, padded = 2 * radius + 1, width + 2 * radius
    rows = surroundings(image, height, radius)
    rows = rows.reshape(batch * groups, channels // groups, height + 2 * radius, padded)
    rows = rows.unfold(2, window, 1).permute(0, 2, 1, 4, 3).flatten(3)  # [B*G, h, C/G, Dy * (w + 2r)]
    cells = lidar.reshape(batch * groups, channels // groups, height, width).permute(0, 2, 3, 1)
    products = cells @ rows  # [B*G, h, w, Dy * (w + 2r)]
    index = band_index(width, radius).to(lidar.device).expand(batch * groups, height, -1, -1)
    volume = products.gather(3, index).view(batch, groups, height, width, -1)
    return volume.permute(0, 4, 2, 3, 1)


@lru_cache(maxsize=32)
def band_index(width: int, radius: int) -> Tensor:
    """``[w, D]``: where cell ``x``'s window lies in a row of ``Dy`` padded image rows laid end to end."""
    with torch.inference_mode(False):  # kept for later: a tensor born in inference could not be trained with
        offset = torch.arange(2 * radius + 1)
        start = offset[:, None] * (width + 2 * radius) + offset  # [Dy, Dx]
        return torch.arange(width)[:, None] + start.flatten()


def concatenate(lidar: Tensor, image: Tensor, radius: int) -> Tensor:
    """Concatenation volume ``[B, D, h, w, 2C]`` of features ``[B, C, h, w]``."""
    window = 2 * radius + 1
    rows = surroundings(image, lidar.shape[2], radius)
    moved = rows.unfold(2, window, 1).unfold(3, window, 1)  # [B, C, h, w, Dy, Dx]
    moved = moved.permute(0, 4, 5, 2, 3, 1).flatten(1, 2)
    fixed = lidar.permute(0, 2, 3, 1)[:, None].expand_as(moved)
    return torch.cat([fixed, moved], dim=-1)


def matching_score(lidar: Tensor, image: Tensor, radius: int) -> Tensor:
    """Cosine ``[B, D, h, w]`` of every LiDAR cell with its window, from features ``[B, C, h, w]``."""
    return correlate(F.normalize(lidar, dim=1), F.normalize(image, dim=1), radius, groups=1)[..., 0]


class CostVolume(nn.Module):
    """The cost volume of one scale."""

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        self.radius, self.groups = config.radius, config.groups
        self.reduce_lidar = nn.Conv2d(config.feature_channels, config.concat_channels, 1)
        self.reduce_image = nn.Conv2d(config.feature_channels, config.concat_channels, 1)

    def forward(self, lidar: Tensor, image: Tensor) -> tuple[Tensor, Tensor]:
        """Compare features ``[B, C, h, w]`` of both branches.

        Returns:
            The volume ``[B, G + 2Cc, D, h, w]`` and the matching score ``[B, D, h, w]``, the cosine
            of the two features (the sum over the groups, since the whole vector has unit norm).
        """
        groups = correlate(F.normalize(lidar, dim=1), F.normalize(image, dim=1), self.radius, self.groups)
        score = groups.sum(-1)
        pair = concatenate(self.reduce_lidar(lidar), self.reduce_image(image), self.radius)
        # a group's share of the cosine is about 1/G: scaled so that all channels start alike
        volume = torch.cat([groups * self.groups, pair.to(groups.dtype)], dim=-1)
        return volume.permute(0, 4, 1, 2, 3), score
