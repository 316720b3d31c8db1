"""Adds a coarse cost volume to the next finer one, and avoids computing their sum where it can.

The window of a coarse scale is twice as wide in pixels as that of the next finer one. So the centre of the coarse
window is interpolated to the displacements of the fine one, and coarse cells are repeated.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import torch
from torch import Tensor

from calibnet.network.convolution import Pointwise


@lru_cache(maxsize=8)
def refinement(window: int, device: torch.device) -> Tensor:
    """The linear map ``[D, D]``, on a device, that samples a flattened window's centre at half-cell steps."""
    with torch.inference_mode(False):  # cached: training could not use a tensor made in inference mode
        radius = window // 2
        position = torch.arange(-radius, radius + 1) / 2 + radius
        along = (1 - (position[:, None] - torch.arange(window)).abs()).clamp(min=0)
        return torch.kron(along, along).to(device)


def refine_window(volume: Tensor) -> Tensor:
    """Interpolate the centre of a coarse window to the fine window; cells stay as they are."""
    rows = volume.flatten(3).flatten(1, 2)  # [B, D, hwC]
    return (refinement(volume.shape[1], rows.device).to(rows) @ rows).view_as(volume)


def upsample_nearest(volume: Tensor) -> Tensor:
    """Repeat every cell 2x2 times: ``[B, Dy, Dx, 2h, 2w, C]``."""
    return volume.repeat_interleave(2, dim=4).repeat_interleave(2, dim=3)


class Fusion(NamedTuple):
    """A volume on the way up, kept as two terms that are not added yet.

    Attributes:
        own: ``[B, Dy, Dx, h, w, C]``, the volume of the scale itself.
        coarser: ``[B, Dy, Dx, h/2, w/2, C]``, the term of the next coarser scale, not interpolated yet; or None.
    """

    own: Tensor
    coarser: Tensor | None = None

    def volume(self) -> Tensor:
        """The sum: ``[B, Dy, Dx, h, w, C]``."""
        return self.own if self.coarser is None else self.own + upsample_nearest(refine_window(self.coarser))

    def read(self, head: Pointwise) -> Tensor:
        """The 1x1x1 convolution ``head`` of the sum: ``[B, Dy, Dx, h, w, C']``.

        Convolution and interpolation are linear. So each term is convolved before it is interpolated, and the sum,
        which at the finest scale is by far the largest volume, is never computed.
        """
        assert head.bias is not None
        coarser = None if self.coarser is None else head(self.coarser) - head.bias  # the bias comes once, with `own`
        return Fusion(head(self.own), coarser).volume()
