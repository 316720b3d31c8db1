"""Aggregation of the cost volumes by a 3-D hourglass that fuses the scales (paper section 3.3).

A window of radius ``r`` means ``r`` cells at every scale, so the window of a coarse scale is twice
as wide in pixels as that of the next finer one. On the way down every second displacement of the
fine window lands in the centre of the coarse one, on the way up that centre is interpolated back:
scales are fused where they speak of the same displacement.
"""

from __future__ import annotations

import itertools
from functools import lru_cache
from typing import cast

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from calibnet.network.config import NetworkConfig
from calibnet.network.convolution import ACTIVATIONS, Conv3d
from calibnet.network.cost_volume import TEMPERATURE


class WindowConv(nn.Module):
    """3-D convolution over one axis of the displacement window and over space.

    The depth ``D`` is the flattened window. The axis that is not convolved is put into the batch, so
    that the end of one row of the window does not leak into the start of the next, as it would in a
    plain 3-D convolution over ``D``.
    """

    def __init__(self, channels: int, window: int, axis: str, activation: str | None = None) -> None:
        super().__init__()
        self.window, self.along_x = window, axis == "x"
        self.conv = Conv3d(channels, channels, 3, padding=1, activation=activation)

    def forward(self, x: Tensor) -> Tensor:
        """``[B, C, D, h, w] -> [B, C, D, h, w]``."""
        batch, channels, _, height, width = x.shape
        rows = x.permute(0, 2, 3, 4, 1).reshape(batch, self.window, self.window, height, width, channels)
        if not self.along_x:
            rows = rows.transpose(1, 2)
        rows = rows.reshape(-1, self.window, height, width, channels)  # memory stays channels last
        y = self.conv(rows.permute(0, 4, 1, 2, 3)).permute(0, 2, 3, 4, 1)
        y = y.reshape(batch, self.window, self.window, height, width, channels)
        if not self.along_x:
            y = y.transpose(1, 2)
        return y.reshape(batch, -1, height, width, channels).permute(0, 4, 1, 2, 3)


def pointwise(conv: nn.Module, volume: Tensor, bias: bool = True) -> Tensor:
    """A 1x1x1 convolution as a product over the channels, which lie last in memory: ``[B, C, D, h, w]``."""
    assert isinstance(conv, nn.Conv3d)
    rows, weight = volume.permute(0, 2, 3, 4, 1), conv.weight.flatten(1)
    return F.linear(rows, weight, conv.bias if bias else None).permute(0, 4, 1, 2, 3)


class Pointwise(Conv3d):
    """A 1x1x1 convolution with its activation: as `pointwise` computes it, until it is packed, which is faster yet."""

    def __init__(self, inputs: int, outputs: int, activation: str | None = None) -> None:
        super().__init__(inputs, outputs, 1, activation=activation)

    def forward(self, volume: Tensor) -> Tensor:
        """``[B, C, D, h, w] -> [B, C', D, h, w]``."""
        return self.packed(volume) if self.packed is not None else ACTIVATIONS[self.activation](pointwise(self, volume))


def pointwise_each(heads: nn.ModuleList, volumes: list[Tensor]) -> list[Tensor]:
    """One 1x1x1 convolution a scale."""
    return [pointwise(head, volume) for head, volume in zip(heads, volumes, strict=True)]


def spatial(conv: nn.Module, volume: Tensor) -> Tensor:
    """A 1x3x3 convolution of stride 2, with the window in the batch: ``[B, C, D, h, w] -> [B, C', D, h/2, w/2]``."""
    assert isinstance(conv, nn.Conv3d)
    batch, channels, window, height, width = volume.shape
    images = volume.permute(0, 2, 3, 4, 1).reshape(-1, height, width, channels).permute(0, 3, 1, 2)
    halved = F.conv2d(images, conv.weight.squeeze(2), conv.bias, stride=2, padding=1).permute(0, 2, 3, 1)
    return halved.unflatten(0, (batch, window)).permute(0, 4, 1, 2, 3)


def double(volume: Tensor) -> Tensor:
    """Repeat every cell 2x2 times: ``[B, C, D, h, w] -> [B, C, D, 2h, 2w]``."""
    batch, channels, window, height, width = volume.shape
    cells = volume.permute(0, 2, 3, 4, 1)[:, :, :, None, :, None]
    cells = cells.expand(batch, window, height, 2, width, 2, channels)
    return cells.reshape(batch, window, 2 * height, 2 * width, channels).permute(0, 4, 1, 2, 3)


class VolumeBlock(nn.Module):
    """A convolution along x, one along y, and a skip: ``[B, C, D, h, w] -> [B, C, D, h, w]``.

    Without normalisation: cosines are well scaled, and its backward pass costs as much as the
    convolutions.
    """

    def __init__(self, channels: int, window: int) -> None:
        super().__init__()
        self.x, self.y = WindowConv(channels, window, "x", "relu"), WindowConv(channels, window, "y")

    def forward(self, volume: Tensor) -> Tensor:
        """``[B, C, D, h, w] -> [B, C, D, h, w]``."""
        return (volume + self.y(self.x(volume))).relu()


def every_second(volume: Tensor, window: int) -> Tensor:
    """The displacements of a fine volume that the coarse window has too: ``[B, C, D, h, w] -> [B, C, D', h, w]``."""
    picked = volume.permute(0, 2, 3, 4, 1).unflatten(1, (window, window))[:, ::2, ::2]  # channels stay last in memory
    return picked.flatten(1, 2).permute(0, 4, 1, 2, 3)


def centre_in_window(volume: Tensor, window: int) -> Tensor:
    """Place them in the centre of the coarse window, zeros around: ``[B, C, D', h, w] -> [B, C, D, h, w]``."""
    side = (window + 1) // 2
    margin = (window - side) // 2
    padded = F.pad(volume.permute(0, 2, 3, 4, 1).unflatten(1, (side, side)), (0, 0) * 3 + (margin, margin) * 2)
    return padded.flatten(1, 2).permute(0, 4, 1, 2, 3)


@lru_cache(maxsize=8)
def refinement(window: int) -> Tensor:
    """Linear map ``[window, window]`` that samples a coarse window's centre at half-cell steps."""
    with torch.inference_mode(False):  # kept for later: a tensor born in inference could not be trained with
        radius = window // 2
        position = torch.arange(-radius, radius + 1) / 2 + radius
        return (1 - (position[:, None] - torch.arange(window)).abs()).clamp(min=0)


def refine_window(volume: Tensor, window: int) -> Tensor:
    """Interpolate the centre of a coarse volume's window to the fine one; space is left as it is."""
    along = refinement(window).to(volume)
    both = torch.einsum("ia,jb->ijab", along, along).reshape(window * window, window * window)
    rows = volume.permute(0, 2, 3, 4, 1)
    return (both @ rows.flatten(2)).view_as(rows).permute(0, 4, 1, 2, 3)


class Hourglass(nn.Module):
    """Down through the scales and up again, with a skip at each."""

    def __init__(self, config: NetworkConfig, blocks: int) -> None:
        super().__init__()
        channels, window = config.channels_at_scales, config.window
        self.window, self.fuse = window, config.hierarchical_fusion
        self.convolve_finest = config.convolve_finest

        def stacks(counts: list[int]) -> nn.ModuleList:
            return nn.ModuleList(
                nn.Sequential(*(VolumeBlock(width, window) for _ in range(number)))
                for width, number in zip(channels, counts, strict=True)
            )

        # the finest scale holds nearly all the work: it is convolved on the way up at most; and where
        # scales are not fused there is no way down
        coarser = len(channels) - 1
        self.down_blocks = stacks([0] + [blocks if self.fuse else 0] * coarser)
        self.up_blocks = stacks([blocks if config.convolve_finest else 0] + [blocks] * coarser)
        if self.fuse:
            steps = list(itertools.pairwise(channels))
            self.down = nn.ModuleList(
                nn.Conv3d(fine, coarse, (1, 3, 3), (1, 2, 2), (0, 1, 1)) for fine, coarse in steps
            )
            self.up = nn.ModuleList(nn.Conv3d(coarse, fine, 1) for fine, coarse in steps)

    def forward(self, volumes: list[Tensor]) -> list[Tensor]:
        """Volumes ``[B, C_s, D, h_s, w_s]``, fine to coarse, to the same shapes."""
        return self.ascend(self.descend(volumes))

    def read(self, entered: list[Tensor], heads: nn.ModuleList) -> list[Tensor]:
        """What one 1x1x1 convolution a scale makes of the volumes that `ascend` makes of those that `descend` gave.

        The finest volume, by far the largest, is the sum of two others where it is not convolved itself: each is
        read by itself, before it is interpolated to all cells and displacements.
        """
        if not self.fuse or len(entered) == 1 or self.convolve_finest:
            return pointwise_each(heads, self.ascend(entered))
        left = self.ascend(entered, finest=1)
        risen = pointwise(heads[0], pointwise(self.up[0], left[0]), bias=False)
        finest = pointwise(heads[0], entered[0]) + double(refine_window(risen, self.window))
        return [finest, *pointwise_each(heads[1:], left)]

    def descend(self, volumes: list[Tensor]) -> list[Tensor]:
        """The way down: each scale with what the finer ones say of the displacements that they share."""
        entered: list[Tensor] = []
        for scale, volume in enumerate(volumes):
            if scale and self.fuse:
                shared = spatial(self.down[scale - 1], every_second(entered[-1], self.window))
                volume = volume + centre_in_window(shared, self.window)
            entered.append(self.down_blocks[scale](volume))
        return entered

    def ascend(self, entered: list[Tensor], finest: int = 0) -> list[Tensor]:
        """The way up to the scale ``finest``, each with what the coarser ones say."""
        left: list[Tensor] = []
        for scale in reversed(range(finest, len(entered))):
            volume = entered[scale]
            if left and self.fuse:
                volume = volume + double(refine_window(pointwise(self.up[scale], left[0]), self.window))
            left.insert(0, self.up_blocks[scale](volume))
        return left


class Aggregation(nn.Module):
    """Volumes of all scales to aggregated volumes and matching scores."""

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        inputs = config.groups + 2 * config.concat_channels
        self.enter = nn.ModuleList(  # each a sequence of one: so its weights are named in the files
            nn.Sequential(Pointwise(inputs, channels, activation="relu")) for channels in config.channels_at_scales
        )
        self.hourglasses = nn.ModuleList(Hourglass(config, blocks) for blocks in config.blocks_of_hourglasses)
        self.score = nn.ModuleList(nn.Conv3d(channels, 1, 1) for channels in config.channels_at_scales)

    def forward(
        self, volumes: list[Tensor], scores: list[Tensor], keep_activations: bool = False
    ) -> tuple[list[Tensor], list[Tensor], list[Tensor]]:
        """Aggregate volumes ``[B, G + 2Cc, D, h_s, w_s]`` and raw scores ``[B, D, h_s, w_s]``, fine to coarse.

        Returns:
            Activations before and after the hourglasses, ``[B, C_s, D, h_s, w_s]``, those after only if they are to
            be kept, and logits ``[B, D, h_s, w_s]`` over the window: the raw score, which is trained to be one by
            itself, and what the hourglasses add to it.
        """
        before = [enter(volume) for enter, volume in zip(self.enter, volumes, strict=True)]
        after = before
        for hourglass in self.hourglasses[:-1]:
            after = hourglass(after)
        if len(self.hourglasses):
            last = cast(Hourglass, self.hourglasses[-1])
            entered = last.descend(after)
            added = last.read(entered, self.score)
            after = last.ascend(entered) if keep_activations else []
        else:
            added = pointwise_each(self.score, after)
        logits = [TEMPERATURE * raw + more.squeeze(1) for raw, more in zip(scores, added, strict=True)]
        return before, after, logits
