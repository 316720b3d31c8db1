"""The two blocks everything is built from: convolution + normalisation + ReLU, and the residual block."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from calibnet.network.convolution import Conv2d


def norm2d(kind: str, channels: int) -> nn.Module:
    """Group norm (statistics of the sample: no lag, no mixing of domains) or batch norm (foldable)."""
    return nn.BatchNorm2d(channels) if kind == "batch" else nn.GroupNorm(group_count(channels), channels)


def group_count(channels: int) -> int:
    """The largest of 8, 4, 2, 1 that divides ``channels``."""
    return next(count for count in (8, 4, 2, 1) if channels % count == 0)


class ConvBlock(nn.Sequential):
    """Convolution, normalisation, ReLU: ``[B, C_in, H, W] -> [B, C_out, H/stride, W/stride]``."""

    def __init__(self, inputs: int, outputs: int, norm: str, stride: int = 1, dilation: int = 1) -> None:
        super().__init__(
            Conv2d(inputs, outputs, 3, stride, padding=dilation, dilation=dilation, bias=False),
            norm2d(norm, outputs),
            nn.ReLU(inplace=True),
        )


class ResidualBlock(nn.Module):
    """Two convolutions and a skip: ``[B, C, H, W] -> [B, C, H, W]``."""

    def __init__(self, channels: int, norm: str) -> None:
        super().__init__()
        self.first = ConvBlock(channels, channels, norm)
        self.second = Conv2d(channels, channels, 3, padding=1, bias=False)
        self.norm = norm2d(norm, channels)

    def forward(self, x: Tensor) -> Tensor:
        """``[B, C, H, W] -> [B, C, H, W]``."""
        return (x + self.norm(self.second(self.first(x)))).relu()


def channels_last(module: nn.Module) -> None:
    """Lay out the weights of 2-D and 3-D convolutions channels last: 2-3 times faster in bf16 on a CPU."""
    for layer in module.modules():
        if isinstance(layer, nn.Conv2d):
            layer.weight.data = layer.weight.data.contiguous(memory_format=torch.channels_last)
        elif isinstance(layer, nn.Conv3d):
            layer.weight.data = layer.weight.data.contiguous(memory_format=torch.channels_last_3d)
