"""Multi-scale cost volumes (paper section 3.2): group-wise correlation and concatenation.

Stereo searches one-sided horizontal disparities. A miscalibration moves points along both axes
and in both directions, so each LiDAR cell is compared with a window of ``(2r+1) x (2r+1)`` image
cells around it, and a volume is ``[B, Dy, Dx, h, w, C]``.
"""

from __future__ import annotations

from functools import lru_cache

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from calibnet.network.config import NetworkConfig
from calibnet.network.convolution import Conv2d

TEMPERATURE = 14.0
"""Cosines of unit-norm features become logits times this."""

RUN = 16
"""Cells of a row that are compared at once, all with the image cells around any of them."""


def surroundings(image: Tensor, height: int, radius: int) -> Tensor:
    """What the windows of the lowest ``height`` rows see of an image: ``[B, C, height + 2r, w + 2r]``.

    Zeros beside it; above, the rows that are there.
    """
    return F.pad(image, [radius] * 4)[:, :, image.shape[2] - height :]


def correlate(lidar: Tensor, image: Tensor, radius: int, groups: int) -> Tensor:
    """Group-wise correlation of every LiDAR cell with the window of image cells around it.

    One batched matrix product of short runs of LiDAR cells with the image cells around them, and a
    gather of the band around the diagonal; a loop of shifted products takes several times as long on a
    CPU, and the product of all pairs of cells many times the memory.

    Args:
        lidar: ``[B, C, h, w]``, of all of the image or of its lowest rows, where the scan is.
        image: ``[B, C, H, w]``, ``H >= h``.
        radius: of the window, in cells.
        groups: number of channel groups, each summed on its own.

    Returns:
        ``[B, Dy, Dx, h, w, groups]`` with zeros where the window leaves the image.
    """
    batch, _, height, width = lidar.shape
    window, runs = 2 * radius + 1, -(-width // RUN)
    beyond = runs * RUN - width
    rows = F.pad(surroundings(image, height, radius), [0, beyond]).unflatten(1, (groups, -1)).flatten(0, 1)
    rows = rows.unfold(2, window, 1).unfold(3, RUN + 2 * radius, RUN)  # [B*G, C/G, h, runs, Dy, R + 2r]
    cells = F.pad(lidar, [0, beyond]).unflatten(1, (groups, -1)).flatten(0, 1).unflatten(3, (runs, RUN))
    products = cells.permute(0, 2, 3, 4, 1) @ rows.permute(0, 2, 3, 1, 4, 5).flatten(4)
    index = band_index(RUN, radius, lidar.device).expand(*products.shape[:4], -1)
    volume = products.gather(4, index).flatten(2, 3)[:, :, :width]  # [B*G, h, w, D]
    return volume.unflatten(3, (window, window)).unflatten(0, (batch, groups)).permute(0, 4, 5, 2, 3, 1)


@lru_cache(maxsize=32)
def band_index(width: int, radius: int, device: torch.device) -> Tensor:
    """``[w, D]``: where the window of cell ``x`` lies in ``Dy`` rows of ``w + 2r`` image cells laid end to end."""
    with torch.inference_mode(False):  # kept for later: a tensor born in inference could not be trained with
        offset = torch.arange(2 * radius + 1, device=device)
        start = offset[:, None] * (width + 2 * radius) + offset  # [Dy, Dx]
        return torch.arange(width, device=device)[:, None] + start.flatten()


def pairs(lidar: Tensor, image: Tensor, radius: int) -> tuple[Tensor, Tensor]:
    """Every LiDAR cell and the cells of its window, both ``[B, Dy, Dx, h, w, C]``, of features ``[B, C, h, w]``."""
    window = 2 * radius + 1
    moved = surroundings(image, lidar.shape[2], radius).unfold(2, window, 1).unfold(3, window, 1)
    moved = moved.permute(0, 4, 5, 2, 3, 1)
    return lidar.permute(0, 2, 3, 1)[:, None, None].expand_as(moved), moved


def matching_score(lidar: Tensor, image: Tensor, radius: int) -> Tensor:
    """Cosine ``[B, D, h, w]`` of every LiDAR cell with its window, from features ``[B, C, h, w]``."""
    return correlate(F.normalize(lidar, dim=1), F.normalize(image, dim=1), radius, groups=1)[..., 0].flatten(1, 2)


class CostVolume(nn.Module):
    """The cost volume of one scale."""

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        self.radius, self.groups = config.radius, config.groups
        self.reduce_lidar = Conv2d(config.feature_channels, config.concat_channels, 1)
        self.reduce_image = Conv2d(config.feature_channels, config.concat_channels, 1)

    def forward(self, lidar: Tensor, image: Tensor) -> tuple[Tensor, Tensor]:
        """Compare features ``[B, C, h, w]`` of both branches.

        Returns:
            The volume ``[B, Dy, Dx, h, w, G + 2Cc]`` and the matching score ``[B, D, h, w]``, the cosine
            of the two features (the sum over the groups, since the whole vector has unit norm).
        """
        groups = correlate(F.normalize(lidar, dim=1), F.normalize(image, dim=1), self.radius, self.groups)
        score = (groups.sum(-1) if self.groups > 1 else groups[..., 0]).flatten(1, 2)
        fixed, moved = pairs(self.reduce_lidar(lidar), self.reduce_image(image), self.radius)
        # a group's share of the cosine is about 1/G: scaled so that all channels start alike
        shares = groups * self.groups if self.groups > 1 else groups
        return torch.cat([shares, fixed.to(groups.dtype), moved.to(groups.dtype)], dim=-1), score
