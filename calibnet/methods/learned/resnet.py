"""ResNet-18 (He et al. 2016) without its classifier, at any width: the encoder of CalibNet, LCCNet and CalibFormer."""

from __future__ import annotations

import torch.nn.functional as F
from torch import Tensor, nn

WIDTHS = (64, 128, 256, 512)
"""Channels at 1/4, 1/8, 1/16 and 1/32."""
BLOCKS = 2
"""Number of residual blocks of each level."""


class BasicBlock(nn.Module):
    """Two 3x3 convolutions and a skip, which is a 1x1 convolution where the shape changes."""

    def __init__(self, inputs: int, outputs: int, stride: int) -> None:
        super().__init__()
        self.residual = nn.Sequential(
            nn.Conv2d(inputs, outputs, 3, stride, 1, bias=False),
            nn.BatchNorm2d(outputs),
            nn.ReLU(inplace=True),
            nn.Conv2d(outputs, outputs, 3, 1, 1, bias=False),
            nn.BatchNorm2d(outputs),
        )
        self.skip: nn.Module = nn.Identity()
        if stride != 1 or inputs != outputs:
            self.skip = nn.Sequential(nn.Conv2d(inputs, outputs, 1, stride, bias=False), nn.BatchNorm2d(outputs))

    def forward(self, x: Tensor) -> Tensor:
        """``[B, C, H, W] -> [B, C', H/stride, W/stride]``."""
        return F.relu(self.skip(x) + self.residual(x))


class ResNet18(nn.Module):
    """The encoder, which returns the features of all levels."""

    def __init__(self, inputs: int, share: float = 1.0) -> None:
        """Take ``inputs`` channels; every level has this ``share`` of the usual channels."""
        super().__init__()
        self.widths = tuple(round(share * width) for width in WIDTHS)
        self.stem = nn.Sequential(
            nn.Conv2d(inputs, self.widths[0], 7, 2, 3, bias=False),
            nn.BatchNorm2d(self.widths[0]),
            nn.ReLU(inplace=True),
            nn.MaxPool2d(3, 2, 1),
        )
        before = (self.widths[0], *self.widths)
        self.levels = nn.ModuleList(
            nn.Sequential(
                BasicBlock(before[level], width, 1 if level == 0 else 2),
                *(BasicBlock(width, width, 1) for _ in range(BLOCKS - 1)),
            )
            for level, width in enumerate(self.widths)
        )

    def forward(self, x: Tensor) -> list[Tensor]:
        """``[B, inputs, H, W]`` to features ``[B, C, H/s, W/s]`` at 1/4, 1/8, 1/16 and 1/32."""
        features, x = [], self.stem(x)
        for level in self.levels:
            x = level(x)
            features.append(x)
        return features
