"""RegNet (Schneider, Piewak, Stiller, Franke, IV 2017): network-in-network blocks on image and depth, regression.

From the paper: blocks of one convolution and two 1x1 convolutions (Lin et al. 2013), one stream for the image and one
with half the channels for the inverse depth, whose sparse points are spread by max pooling; the streams are
concatenated, two more blocks match them, and two fully connected layers regress a dual quaternion under a Euclidean
loss. Five such networks, of ever narrower ranges, run one after the other.

Ours: batch normalisation after the first convolution of every block, as the paper's image stream starts from ImageNet
and this one from random weights; the depth map is pooled over 5 pixels; pooling after the blocks, so that 2 x 4 cells
remain of 256 x 512 pixels; both parts of the dual quaternion are in units of the range, see
`calibnet.methods.learned.network.scaled_pose`.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from calibnet.geometry import MiscalibrationRange
from calibnet.methods.learned.config import MethodConfig
from calibnet.methods.learned.losses import method_losses
from calibnet.methods.learned.network import MethodLosses, MethodNetwork, MethodOutput, output_layer
from calibnet.network.batch import NetworkInputs
from calibnet.network.pose import rigid, rotation_from_quaternion
from calibnet.network.target import Target

PICTURE = (96, 256, 384)
DEPTH = (48, 128, 192)
MATCHING = 512
HIDDEN = 700
KERNELS = (11, 5, 3)
REMAINING = (2, 4)
"""Size of the features after the last block, in cells."""


class Block(nn.Sequential):
    """A convolution and two 1x1 convolutions with ReLUs, then, if ``pooled``, max pooling to half the size."""

    def __init__(self, inputs: int, outputs: int, kernel: int, stride: int = 1, pooled: bool = True) -> None:
        layers: list[nn.Module] = [
            nn.Conv2d(inputs, outputs, kernel, stride, kernel // 2, bias=False),
            nn.BatchNorm2d(outputs),
            nn.ReLU(inplace=True),
        ]
        for _ in range(2):
            layers += [nn.Conv2d(outputs, outputs, 1), nn.ReLU(inplace=True)]
        super().__init__(*layers, *([nn.MaxPool2d(3, 2, 1)] if pooled else []))


def stream(inputs: int, widths: tuple[int, ...]) -> nn.Sequential:
    """Three blocks, ``[B, inputs, H, W] -> [B, C, H/32, W/32]``."""
    channels = (inputs, *widths)
    return nn.Sequential(
        *(
            Block(channels[position], channels[position + 1], kernel, 4 if position == 0 else 1)
            for position, kernel in enumerate(KERNELS)
        )
    )


class RegNet(MethodNetwork):
    """Image and depth to a dual quaternion."""

    NAME, CASCADED, POOLING = "regnet", True, 5

    def __init__(self, config: MethodConfig, range_: MiscalibrationRange) -> None:
        super().__init__(config, range_)
        self.picture, self.depth = stream(3, PICTURE), stream(1, DEPTH)
        self.matching = nn.Sequential(
            Block(PICTURE[-1] + DEPTH[-1], MATCHING, 5), Block(MATCHING, MATCHING, 3), nn.AdaptiveAvgPool2d(REMAINING)
        )
        self.regression = nn.Sequential(
            nn.Flatten(),
            nn.Linear(MATCHING * REMAINING[0] * REMAINING[1], HIDDEN),
            nn.ReLU(inplace=True),
            output_layer(HIDDEN, 8),
        )

    def estimate(self, image: Tensor, depth: Tensor) -> MethodOutput:
        """See `MethodNetwork.estimate`; ``regressed`` is the dual quaternion in units of the range, ``[B, 8]``."""
        picture, scan = self.picture(image), self.depth(depth)
        matched = self.matching(torch.cat([picture, scan], dim=1))
        regressed = self.regression(matched).float()
        shown = {"Image features": picture.abs().mean(1), "Depth features": scan.abs().mean(1)}
        return MethodOutput(self._pose(regressed), regressed, shown)

    def losses(self, output: MethodOutput, inputs: NetworkInputs, target: Target) -> MethodLosses:
        """Half the squared distance of the dual quaternions, in units of the range."""
        error = 0.5 * (output.regressed - self.in_units(target.correction)).square()
        rotation, translation = error[:, :4].sum(-1).mean(), error[:, 4:].sum(-1).mean()
        return method_losses(output.correction, target.correction, translation, rotation)

    def in_units(self, correction: Tensor) -> Tensor:
        """The target ``[B, 8]`` of the regression for ``[B, 4, 4]``: real part minus the identity, and dual part."""
        real = quaternion_of(correction[:, :3, :3])
        dual = 0.5 * product(pure(correction[:, :3, 3]), real)
        half_angle, half_offset = self._units(correction)
        return torch.cat([(real - identity(real)) / half_angle, dual / half_offset], dim=-1)

    def _pose(self, regressed: Tensor) -> Tensor:
        half_angle, half_offset = self._units(regressed)
        real = identity(regressed) + half_angle * regressed[:, :4]
        length = real.norm(dim=-1, keepdim=True)
        real, dual = real / length, half_offset * regressed[:, 4:] / length
        translation = 2.0 * product(dual, conjugate(real))[:, 1:]
        return rigid(rotation_from_quaternion(real), translation)

    def _units(self, like: Tensor) -> tuple[Tensor, Tensor]:
        half_angle = torch.deg2rad(torch.tensor(self.range.rotation_deg / 2)).to(like)
        return half_angle, torch.tensor(self.range.translation_m / 2).to(like)


def identity(like: Tensor) -> Tensor:
    """The identity quaternion, ``[4]``."""
    return like.new_tensor([1.0, 0.0, 0.0, 0.0])


def pure(vector: Tensor) -> Tensor:
    """Vectors ``[B, 3]`` as quaternions ``[B, 4]`` (w, x, y, z)."""
    return torch.cat([torch.zeros_like(vector[:, :1]), vector], dim=-1)


def conjugate(quaternion: Tensor) -> Tensor:
    """The inverse of unit quaternions ``[B, 4]``."""
    return torch.cat([quaternion[:, :1], -quaternion[:, 1:]], dim=-1)


def product(left: Tensor, right: Tensor) -> Tensor:
    """The product of quaternions ``[B, 4]``."""
    a, u, b, v = left[:, :1], left[:, 1:], right[:, :1], right[:, 1:]
    real = a * b - (u * v).sum(-1, keepdim=True)
    return torch.cat([real, a * v + b * u + torch.linalg.cross(u, v)], dim=-1)


def quaternion_of(rotation: Tensor) -> Tensor:
    """Unit quaternions ``[B, 4]`` with positive real part of rotations ``[B, 3, 3]`` by less than 180 degrees."""
    real = 0.5 * (1 + rotation.diagonal(dim1=1, dim2=2).sum(-1)).clamp(min=1e-6).sqrt()
    skewed = rotation - rotation.transpose(1, 2)
    axis = torch.stack([skewed[:, 2, 1], skewed[:, 0, 2], skewed[:, 1, 0]], dim=-1)
    return torch.cat([real[:, None], axis / (4 * real[:, None])], dim=-1)
