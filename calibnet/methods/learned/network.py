"""The interface of the networks of other papers: input, output, and a loss of their own."""

from __future__ import annotations

from typing import ClassVar, NamedTuple

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from calibnet.geometry import MiscalibrationRange
from calibnet.methods.learned.config import MethodConfig
from calibnet.network.batch import NetworkInputs
from calibnet.network.channels import image_channels, inverse_depth
from calibnet.network.pose import rigid, rotation_from_quaternion
from calibnet.network.target import Target


class MethodOutput(NamedTuple):
    """The output of such a network for a batch.

    Attributes:
        correction: ``[B, 4, 4]`` float32, ``after = correction @ before``.
        regressed: ``[B, N]`` float32, the regressed numbers that the correction is computed from.
        shown: maps ``[B, h, w]`` for the viewer, by title.
    """

    correction: Tensor
    regressed: Tensor
    shown: dict[str, Tensor]


class MethodLosses(NamedTuple):
    """The terms of a method's loss, each already weighted, and two figures for the progress line.

    A term that a method does not have is zero.
    """

    translation: Tensor
    rotation: Tensor
    points: Tensor
    photometric: Tensor
    rotation_deg: Tensor
    translation_cm: Tensor

    @property
    def total(self) -> Tensor:
        """The loss that is minimised."""
        return self.translation + self.rotation + self.points + self.photometric


class MethodNetwork(nn.Module):
    """A network that corrects a pose from the whole image and the depth map of the projected scan.

    Subclasses build their layers in ``__init__``, and implement `estimate` and `losses`.
    """

    NAME: ClassVar[str]
    LOOKS: ClassVar[int] = 1
    """Number of looks at a frame, each with the scan projected under the result of the one before."""
    CASCADED: ClassVar[bool] = False
    """Whether the paper runs networks of ever narrower ranges in sequence."""
    LEARNING_RATE: ClassVar[float] = 3e-4
    """Default peak of the learning rate."""
    POOLING: ClassVar[int] = 1
    """Side of the squares over which the depth map is max-pooled (nearest point) to make it denser."""

    def __init__(self, config: MethodConfig, range_: MiscalibrationRange) -> None:
        super().__init__()
        self.config, self.range = config, range_

    def forward(self, inputs: NetworkInputs) -> MethodOutput:
        """Estimate the correction of a batch, of any image size."""
        size = (self.config.input_height, self.config.input_width)
        depth = fitted_depth(inputs, *size)
        if self.POOLING > 1:
            depth = F.max_pool2d(depth, self.POOLING, 1, self.POOLING // 2)
        output = self.estimate(fitted_image(inputs, *size), depth)
        seen = depth[:, 0].masked_fill(depth[:, 0] == 0, torch.nan)
        return output._replace(shown={"Inverse depth, input of the network": seen, **output.shown})

    def estimate(self, image: Tensor, depth: Tensor) -> MethodOutput:
        """Estimate from an image ``[B, 3, H, W]``, zero mean and unit variance, and inverse depth ``[B, 1, H, W]``."""
        raise NotImplementedError

    def losses(self, output: MethodOutput, inputs: NetworkInputs, target: Target) -> MethodLosses:
        """The loss of the method."""
        raise NotImplementedError


def output_layer(inputs: int, outputs: int) -> nn.Linear:
    """The last layer of all networks, with weights so small that an untrained network hardly corrects anything."""
    layer = nn.Linear(inputs, outputs)
    nn.init.normal_(layer.weight, std=1e-3)
    nn.init.zeros_(layer.bias)
    return layer


def fitted_image(inputs: NetworkInputs, height: int, width: int) -> Tensor:
    """The images of a batch at a network's fixed size, their aspect not kept: ``[B, 3, height, width]``."""
    image = F.interpolate(inputs.image.float(), (height, width), mode="bilinear", align_corners=False)
    return image_channels(image)


def fitted_depth(inputs: NetworkInputs, height: int, width: int) -> Tensor:
    """The depth maps at a network's fixed size as inverse depth ``[B, 1, height, width]``; the nearest point wins.

    The rows that `calibnet.network.batch.Cut` cropped are put back, empty.
    """
    inverse = inverse_depth(inputs.lidar[:, 0].float())  # [B, H', W]
    batch, rows, columns = inverse.shape
    full = inputs.image.shape[2]
    row = torch.arange(full - rows, full, device=inverse.device)
    column = torch.arange(columns, device=inverse.device)
    # the cell in which the scaled centre of each pixel lies
    index = ((row + 0.5) * height / full).long()[:, None] * width + ((column + 0.5) * width / columns).long()
    flat = inverse.new_zeros(batch, height * width)
    flat.scatter_reduce_(1, index.flatten().expand(batch, -1), inverse.flatten(1), "amax")
    return flat.view(batch, 1, height, width)


def scaled_pose(translation: Tensor, rotation: Tensor, range_: MiscalibrationRange) -> Tensor:
    """The correction ``[B, 4, 4]`` from regressed numbers, in units of the range.

    The papers regress metres and quaternions in whatever scale the last layer learns. Here 1 is the limit of the range,
    so that an untrained network, whose outputs are small, corrects little, and all ranges train alike.

    Args:
        translation: ``[B, 3]``, where 1 is the largest translation.
        rotation: ``[B, 4]``, added to the identity quaternion (w, x, y, z), where 1 is the largest angle.
        range_: range of the network.
    """
    half_angle = torch.deg2rad(torch.tensor(range_.rotation_deg / 2)).to(rotation)
    identity = rotation.new_tensor([1.0, 0.0, 0.0, 0.0])
    quaternion = identity + half_angle * rotation.float()
    return rigid(rotation_from_quaternion(quaternion), translation.float() * range_.translation_m)
