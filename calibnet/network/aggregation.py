"""Aggregation of the cost volumes by a 3-D hourglass that fuses the scales (paper section 3.3).

A volume is ``[B, Dy, Dx, h, w, C]``: for every displacement of the window and every cell a vector of channels. A
convolution of PyTorch wants the channels before what it runs over; `convolve` gives it that view.

A window of radius ``r`` means ``r`` cells at every scale, so the window of a coarse scale is twice as wide in pixels as
that of the next finer one. On the way down every second displacement of the fine window lands in the centre of the
coarse one, on the way up that centre is interpolated back: scales are fused where they speak of the same displacement.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from functools import lru_cache, partial
from typing import NamedTuple

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from calibnet.network.config import NetworkConfig
from calibnet.network.convolution import Conv3d, Pointwise
from calibnet.network.cost_volume import TEMPERATURE


def convolve(convolution: Callable[[Tensor], Tensor], rows: Tensor) -> Tensor:
    """Apply to ``[N, ..., C]`` a convolution that takes ``[N, C, ...]``; the channels stay last in memory."""
    return convolution(rows.movedim(-1, 1)).movedim(1, -1)


class WindowConv(nn.Module):
    """A 3x3x3 convolution over space and one axis of the window, ``"x"`` or ``"y"``.

    The window's other axis is put into the batch. In a convolution over the flattened window the end of one row would
    leak into the start of the next.
    """

    def __init__(self, channels: int, axis: str, activation: str | None = None) -> None:
        super().__init__()
        self.other = {"x": 1, "y": 2}[axis]
        self.conv = Conv3d(channels, channels, 3, padding=1, activation=activation)

    def forward(self, volume: Tensor) -> Tensor:
        """``[B, Dy, Dx, h, w, C] -> [B, Dy, Dx, h, w, C]``."""
        rows = volume.movedim(self.other, 1)
        return convolve(self.conv, rows.flatten(0, 1)).unflatten(0, rows.shape[:2]).movedim(1, self.other)


class VolumeBlock(nn.Module):
    """A convolution along x, one along y, and a skip.

    There is no normalisation: cosines are well scaled, and its backward pass costs as much as the convolutions.
    """

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.x, self.y = WindowConv(channels, "x", "relu"), WindowConv(channels, "y")

    def forward(self, volume: Tensor) -> Tensor:
        """``[B, Dy, Dx, h, w, C] -> [B, Dy, Dx, h, w, C]``."""
        return F.relu(volume + self.y(self.x(volume)), inplace=True)


class Down(nn.Conv3d):
    """A 1x3x3 convolution of stride 2 over the displacements of a fine scale that the coarse one has too."""

    def __init__(self, fine: int, coarse: int) -> None:
        super().__init__(fine, coarse, (1, 3, 3), (1, 2, 2), (0, 1, 1))

    def forward(self, volume: Tensor) -> Tensor:
        """``[B, Dy, Dx, h, w, C] -> [B, Dy, Dx, h/2, w/2, C']``, zeros where the coarse window reaches farther."""
        shared = volume[:, ::2, ::2]
        halve = partial(F.conv2d, weight=self.weight.squeeze(2), bias=self.bias, stride=2, padding=1)
        halved = convolve(halve, shared.flatten(0, 2)).unflatten(0, shared.shape[:3])
        margin = (volume.shape[1] - shared.shape[1]) // 2
        return F.pad(halved, (0, 0) * 3 + (margin, margin) * 2)


@lru_cache(maxsize=8)
def refinement(window: int, device: torch.device) -> Tensor:
    """The linear map ``[D, D]``, on a device, that samples a flattened window's centre at half-cell steps."""
    with torch.inference_mode(False):  # kept for later: a tensor born in inference could not be trained with
        radius = window // 2
        position = torch.arange(-radius, radius + 1) / 2 + radius
        along = (1 - (position[:, None] - torch.arange(window)).abs()).clamp(min=0)
        return torch.kron(along, along).to(device)


def refine_window(volume: Tensor) -> Tensor:
    """Interpolate the centre of a coarse window to the fine window; cells stay as they are."""
    rows = volume.flatten(3).flatten(1, 2)  # [B, D, hwC]
    return (refinement(volume.shape[1], rows.device).to(rows) @ rows).view_as(volume)


def double(volume: Tensor) -> Tensor:
    """Repeat every cell 2x2 times: ``[B, Dy, Dx, 2h, 2w, C]``."""
    return volume.repeat_interleave(2, dim=4).repeat_interleave(2, dim=3)


class Fusion(NamedTuple):
    """A volume on the way up as the two parts that make it up.

    Attributes:
        own: ``[B, Dy, Dx, h, w, C]``, of the scale itself.
        coarser: ``[B, Dy, Dx, h/2, w/2, C]``, what the next coarser scale adds, if anything; not interpolated yet.
    """

    own: Tensor
    coarser: Tensor | None = None

    def volume(self) -> Tensor:
        """The sum: ``[B, Dy, Dx, h, w, C]``."""
        return self.own if self.coarser is None else self.own + double(refine_window(self.coarser))

    def read(self, head: nn.Module) -> Tensor:
        """What a 1x1x1 convolution makes of the sum: ``[B, Dy, Dx, h, w, C']``.

        It is linear and so is the interpolation. So each part is read before it is interpolated, and the sum, which at
        the finest scale is by far the largest volume, is never made.
        """
        assert isinstance(head, Pointwise) and head.bias is not None
        coarser = None if self.coarser is None else head(self.coarser) - head.bias  # which is to be added once
        return Fusion(head(self.own), coarser).volume()


class Hourglass(nn.Module):
    """Down through the scales and up again, with a skip at each."""

    def __init__(self, config: NetworkConfig, blocks: int) -> None:
        super().__init__()
        channels, fuse = config.channels_at_scales, config.hierarchical_fusion
        self.convolve_finest = config.convolve_finest

        def stacks(finest: int, coarser: int) -> nn.ModuleList:
            counts = [finest] + [coarser] * (len(channels) - 1)
            widths = zip(channels, counts, strict=True)
            return nn.ModuleList(nn.Sequential(*(VolumeBlock(width) for _ in range(count))) for width, count in widths)

        # the finest scale holds nearly all the work: it is convolved on the way up at most
        self.down_blocks = stacks(0, blocks if fuse else 0)
        self.up_blocks = stacks(blocks if config.convolve_finest else 0, blocks)
        steps = list(itertools.pairwise(channels)) if fuse else []
        self.down = nn.ModuleList(Down(fine, coarse) for fine, coarse in steps)
        self.up = nn.ModuleList(Pointwise(coarse, fine) for fine, coarse in steps)

    def forward(self, volumes: list[Tensor]) -> list[Fusion]:
        """Volumes ``[B, Dy, Dx, h_s, w_s, C_s]``, fine to coarse, to fused volumes of the same shapes."""
        volumes, fused = list(volumes), list[Fusion]()
        for scale, down in enumerate(self.down, start=1):
            volumes[scale] = self.down_blocks[scale](volumes[scale] + down(volumes[scale - 1]))
        for scale in reversed(range(len(volumes))):  # the coarsest has none to hear from; without fusion none has
            fusion = Fusion(volumes[scale], self.up[scale](fused[0].volume()) if scale < len(self.up) else None)
            if scale or self.convolve_finest:
                fusion = Fusion(self.up_blocks[scale](fusion.volume()))
            fused.insert(0, fusion)
        return fused


class Aggregation(nn.Module):
    """Volumes of all scales to aggregated volumes and matching scores."""

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        inputs, channels = config.groups + 2 * config.concat_channels, config.channels_at_scales
        # each a sequence of one: so its weights are named in the files
        self.enter = nn.ModuleList(nn.Sequential(Pointwise(inputs, width, "relu")) for width in channels)
        self.hourglasses = nn.ModuleList(Hourglass(config, blocks) for blocks in config.blocks_of_hourglasses)
        self.score = nn.ModuleList(Pointwise(width, 1) for width in channels)

    def forward(
        self, volumes: list[Tensor], scores: list[Tensor], keep_activations: bool = False
    ) -> tuple[list[Tensor], list[Tensor], list[Tensor]]:
        """Aggregate volumes ``[B, Dy, Dx, h_s, w_s, G + 2Cc]`` and raw scores ``[B, D, h_s, w_s]``, fine to coarse.

        Returns:
            Activations before and after the hourglasses, ``[B, Dy, Dx, h_s, w_s, C_s]``, those after only if they are
            to be kept, and logits ``[B, D, h_s, w_s]`` over the window: the raw score, which is trained to be one by
            itself, and what the hourglasses add to it.
        """
        before = [enter(volume) for enter, volume in zip(self.enter, volumes, strict=True)]
        fused = [Fusion(volume) for volume in before]
        for hourglass in self.hourglasses:
            fused = hourglass([fusion.volume() for fusion in fused])
        added = [fusion.read(head)[..., 0].flatten(1, 2) for fusion, head in zip(fused, self.score, strict=True)]
        logits = [TEMPERATURE * raw + more for raw, more in zip(scores, added, strict=True)]
        after = [fusion.volume() for fusion in fused] if keep_activations else []
        return before, after, logits
