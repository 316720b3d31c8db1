"""The convolutional part of EfficientNet-Lite0: the image encoder that starts from ImageNet (not in the paper).

Frames with a calibrated LiDAR are few, images are many: features learned on a million images recognise edges and
objects from the start and with any camera, whereas features learned from calibration data alone take an hour to
recognise anything. EfficientNet-Lite (Tan and Le, 2019, in its form for phones) has neither squeeze-and-excitation nor
swish, so its batch norms fold into its convolutions, which are cheap on a CPU.
"""

from __future__ import annotations

from pathlib import Path

import torch
import torch.nn.functional as F
from safetensors.torch import load_file
from torch import Tensor, nn

from calibnet.network.convolution import Conv2d

LEVELS = (
    ((1, 16, 3, 1, 1),),  # 1/2, after a stem of 32 channels
    ((2, 24, 3, 2, 6),),  # 1/4
    ((2, 40, 5, 2, 6),),  # 1/8
    ((3, 80, 3, 2, 6), (3, 112, 5, 1, 6)),  # 1/16
)
"""Groups of blocks at each level: number of blocks, channels, kernel size, stride of the first, expansion."""

WIDTHS = tuple(level[-1][1] for level in LEVELS)
"""Channels at 1/2, 1/4, 1/8 and 1/16. The blocks at 1/32, three quarters of its parameters, are left out."""

WEIGHTS = Path(__file__).parents[1] / "weights" / "efficientnet-lite0.safetensors"
"""ImageNet weights, Apache-2.0; docs/weights.md says how they were made, under "The image encoder's conversion"."""


class SameConv(Conv2d):
    """Convolution of an even size with TensorFlow's padding, which at stride 2 is one wider on the far side.

    Padding a wide input first would be slow. So the convolution pads both sides alike, one wider than needed on the
    near side, and the first row and column of its result, the margin, are dropped.
    """

    def __init__(
        self, inputs: int, outputs: int, kernel: int, stride: int = 1, groups: int = 1, activation: str | None = None
    ) -> None:
        padding = (kernel + stride - 1) // 2
        super().__init__(inputs, outputs, kernel, stride, padding=padding, groups=groups, activation=activation)

    def forward(self, x: Tensor) -> Tensor:
        """``[B, C, H, W] -> [B, C', H/stride, W/stride]``."""
        return self.without_margin(self.with_margin(x))

    def with_margin(self, x: Tensor) -> Tensor:
        """The result with its margin, which it has at stride 2: ``[B, C', H/stride + 1, W/stride + 1]``."""
        if self.training and self.groups > 1 and x.device.type == "cpu":
            with torch.autocast("cpu", enabled=False):  # oneDNN's gradients of these take three times as long in bf16
                return super().forward(x.float())
        return super().forward(x)

    def without_margin(self, y: Tensor) -> Tensor:
        """Drop the margin from the result of `with_margin`, or from what was computed from it cell by cell."""
        return y[:, :, 1:, 1:] if self.stride[0] > 1 else y


class Stem(SameConv):
    """The first convolution, of stride 2.

    Its result is large, and the next layer reads all of it. So the packed form makes no margin: a first row and column
    of zeros in its weights shift the result instead.
    """

    def pack(self, precision: torch.dtype) -> None:
        """See `Conv2d.pack`."""
        kernel, padding = self.kernel_size[0] + 1, (self.kernel_size[0] - 1) // 2
        shifted = Conv2d(
            self.in_channels, self.out_channels, kernel, self.stride, padding=padding, activation=self.activation
        )
        shifted.weight.data, shifted.bias = F.pad(self.weight.data, (1, 0, 1, 0)), self.bias
        shifted.pack(precision)
        self.packed = shifted.packed

    def without_margin(self, y: Tensor) -> Tensor:
        """See `SameConv.without_margin`."""
        return y if self.packed else super().without_margin(y)


class InvertedResidual(nn.Module):
    """Widen, filter every channel on its own, narrow; with a skip where the shape stays: ``[B, C, H, W]``."""

    def __init__(self, inputs: int, outputs: int, kernel: int, stride: int, expansion: int) -> None:
        super().__init__()
        width = inputs * expansion
        self.expand = SameConv(inputs, width, 1, activation="relu6") if expansion > 1 else None
        self.depthwise = SameConv(width, width, kernel, stride, groups=width, activation="relu6")
        self.narrow = SameConv(width, outputs, 1)
        self.skip = stride == 1 and inputs == outputs

    def forward(self, x: Tensor) -> Tensor:
        """``[B, C, H, W] -> [B, C', H/stride, W/stride]``."""
        wide = x if self.expand is None else self.expand(x)
        y = self.depthwise.without_margin(self.narrow(self.depthwise.with_margin(wide)))  # cheaper to drop when narrow
        return x + y if self.skip else y


def efficientnet_levels() -> list[nn.Sequential]:
    """The encoder's levels from the image to 1/16, to be run in sequence; random until weights are loaded."""
    levels, channels = [], 32
    for position, groups in enumerate(LEVELS):
        modules: list[nn.Module] = [] if position else [Stem(3, channels, 3, 2, activation="relu6"), nn.Identity()]
        for number, width, kernel, stride, expansion in groups:
            for block in range(number):
                modules.append(InvertedResidual(channels, width, kernel, 1 if block else stride, expansion))
                channels = width
        levels.append(nn.Sequential(*modules))
    return levels


def load_weights() -> dict[str, Tensor]:
    """The ImageNet weights of `efficientnet_levels`, named as in an ``nn.ModuleList`` of them."""
    return {name: tensor.float() for name, tensor in load_file(WEIGHTS).items()}
