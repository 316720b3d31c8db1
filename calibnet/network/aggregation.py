"""Aggregation of the cost volumes by a 3-D hourglass that fuses the scales (paper section 3.3).

A volume is ``[B, Dy, Dx, h, w, C]``: for every displacement of the window and every cell a vector of channels.

A window of radius ``r`` means ``r`` cells at every scale, so the window of a coarse scale is twice as wide in pixels as
that of the next finer one. On the way down every second displacement of the fine window lands in the centre of the
coarse one, on the way up that centre is interpolated back: so scales are fused at the same displacement.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from functools import partial
from typing import NamedTuple, cast

import torch.nn.functional as F
from torch import Tensor, nn

from calibnet.network.config import NetworkConfig
from calibnet.network.convolution import Conv3d, Pointwise, channels_last_in
from calibnet.network.cost_volume import LOGIT_SCALE, Volume
from calibnet.network.fusion import Fusion


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
        return channels_last_in(self.conv, rows.flatten(0, 1)).unflatten(0, rows.shape[:2]).movedim(1, self.other)


class VolumeBlock(nn.Module):
    """A convolution along x, one along y, and a skip.

    There is no normalisation: cosines are well scaled, and its backward pass would cost as much as the convolutions.
    """

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.x, self.y = WindowConv(channels, "x", "relu"), WindowConv(channels, "y")

    def forward(self, volume: Tensor) -> Tensor:
        """``[B, Dy, Dx, h, w, C] -> [B, Dy, Dx, h, w, C]``."""
        return F.relu(volume + self.y(self.x(volume)), inplace=True)


def volume_blocks(channels: int, number: int) -> nn.Sequential:
    """``number`` blocks in sequence."""
    return nn.Sequential(*(VolumeBlock(channels) for _ in range(number)))


class Down(nn.Conv3d):
    """A 1x3x3 convolution of stride 2, at those displacements of a fine scale that the coarse scale has too.

    Its weights are those of a 3-D convolution; it runs as one 2-D convolution for all displacements.
    """

    def __init__(self, fine: int, coarse: int) -> None:
        super().__init__(fine, coarse, (1, 3, 3), (1, 2, 2), (0, 1, 1))

    def forward(self, volume: Tensor) -> Tensor:
        """``[B, Dy, Dx, h, w, C] -> [B, Dy, Dx, h/2, w/2, C']``, zeros where the coarse window reaches farther."""
        shared = volume[:, ::2, ::2]
        halve = partial(F.conv2d, weight=self.weight.squeeze(2), bias=self.bias, stride=2, padding=1)
        halved = channels_last_in(halve, shared.flatten(0, 2)).unflatten(0, shared.shape[:3])
        margin = (volume.shape[1] - shared.shape[1]) // 2
        return F.pad(halved, (0, 0) * 3 + (margin, margin) * 2)


class Hourglass(nn.Module):
    """Down through the scales and up again, with a skip at each; without hierarchical fusion each scale by itself."""

    def __init__(self, config: NetworkConfig, blocks: int) -> None:
        super().__init__()
        channels, fuse = config.channels_at_scales, config.hierarchical_fusion
        self.convolve_finest = config.convolve_finest
        steps = list(itertools.pairwise(channels)) if fuse else []
        # the finest scale is nearly all of the work: it is convolved on the way up only, if at all
        self.down_blocks = nn.ModuleList(
            volume_blocks(width, blocks if fuse and scale else 0) for scale, width in enumerate(channels)
        )
        self.up_blocks = nn.ModuleList(
            volume_blocks(width, blocks if scale or config.convolve_finest else 0)
            for scale, width in enumerate(channels)
        )
        self.down = nn.ModuleList(Down(fine, coarse) for fine, coarse in steps)
        self.up = nn.ModuleList(Pointwise(coarse, fine) for fine, coarse in steps)

    def forward(self, volumes: list[Tensor]) -> list[Fusion]:
        """Volumes ``[B, Dy, Dx, h_s, w_s, C_s]``, fine to coarse, to fused volumes of the same shapes."""
        volumes = list(volumes)
        for scale, down in enumerate(self.down, start=1):
            volumes[scale] = self.down_blocks[scale](volumes[scale] + down(volumes[scale - 1]))
        fused = [Fusion(volume) for volume in volumes]
        for scale in reversed(range(len(volumes))):
            if scale < len(self.up):
                fused[scale] = Fusion(volumes[scale], self.up[scale](fused[scale + 1].volume()))
            if scale or self.convolve_finest:
                fused[scale] = Fusion(self.up_blocks[scale](fused[scale].volume()))
        return fused


class Activations(NamedTuple):
    """The volumes around the hourglasses, ``[B, C, D, h_s, w_s]`` per scale, fine to coarse."""

    before: list[Tensor]
    after: list[Tensor]


class Aggregated(NamedTuple):
    """The output of the hourglasses.

    Attributes:
        logits: ``[B, D, h_s, w_s]`` over the window, per scale, fine to coarse.
        activations: only when asked for.
    """

    logits: list[Tensor]
    activations: Activations | None


class Aggregation(nn.Module):
    """Volumes of all scales through the hourglasses to logits.

    A logit is the volume's cosine, which is trained to match by itself, plus what the hourglasses add to it.
    """

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        inputs, channels = config.groups + 2 * config.concat_channels, config.channels_at_scales
        # sequences of one, since the files of weights name parameters so
        self.enter = nn.ModuleList(nn.Sequential(Pointwise(inputs, width, "relu")) for width in channels)
        self.hourglasses = nn.ModuleList(Hourglass(config, blocks) for blocks in config.blocks_of_hourglasses)
        self.score = nn.ModuleList(Pointwise(width, 1) for width in channels)

    def forward(self, volumes: list[Volume], keep_activations: bool = False) -> Aggregated:
        """Aggregate volumes of all scales, fine to coarse."""
        entered = [enter(volume.channels) for enter, volume in zip(self.enter, volumes, strict=True)]
        fused = [Fusion(volume) for volume in entered]
        for hourglass in self.hourglasses:
            fused = hourglass([fusion.volume() for fusion in fused])
        heads = cast(Iterable[Pointwise], self.score)
        added = [fusion.read(head)[..., 0].flatten(1, 2) for fusion, head in zip(fused, heads, strict=True)]
        logits = [LOGIT_SCALE * volume.score + more for volume, more in zip(volumes, added, strict=True)]
        if not keep_activations:
            return Aggregated(logits, None)
        after = [fusion.volume() for fusion in fused]
        return Aggregated(logits, Activations(channels_first(entered), channels_first(after)))


def channels_first(volumes: list[Tensor]) -> list[Tensor]:
    """Volumes ``[B, Dy, Dx, h, w, C]`` as ``[B, C, D, h, w]``."""
    return [volume.flatten(1, 2).movedim(-1, 1) for volume in volumes]
