"""What the networks of other papers have in common: what goes in, what comes out, and a loss of their own."""

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
    """What such a network says of a batch.

    Attributes:
        correction: ``[B, 4, 4]`` float32, ``after = correction @ before``.
        regressed: ``[B, N]`` float32, the numbers it is made from, where the loss is about them.
        shown: maps ``[B, h, w]`` by a name for people, for the viewer.
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
        """What is minimised."""
        return self.translation + self.rotation + self.points + self.photometric


class MethodNetwork(nn.Module):
    """A network that corrects a pose from the whole picture and the depth map of the projected scan.

    Subclasses build their layers in ``__init__``, and have `estimate` and `losses`.
    """

    NAME: ClassVar[str]
    LOOKS: ClassVar[int] = 1
    """How often the trained network looks at a frame, each time at the scan projected anew."""
    CASCADED: ClassVar[bool] = False
    """Whether its paper runs networks of ever narrower ranges one after the other."""
    LEARNING_RATE: ClassVar[float] = 3e-4
    """Peak of the learning rate that it is trained with by default."""
    POOLING: ClassVar[int] = 1
    """Side of the squares over which the depth map is pooled (nearest point), so that it becomes dense."""

    def __init__(self, config: MethodConfig, range_: MiscalibrationRange) -> None:
        super().__init__()
        self.config, self.range = config, range_

    def forward(self, inputs: NetworkInputs) -> MethodOutput:
        """Estimate the correction of a batch of any size of picture."""
        size = (self.config.input_height, self.config.input_width)
        depth = fitted_depth(inputs, *size)
        if self.POOLING > 1:
            depth = F.max_pool2d(depth, self.POOLING, 1, self.POOLING // 2)
        output = self.estimate(fitted_image(inputs, *size), depth)
        seen = depth[:, 0].masked_fill(depth[:, 0] == 0, torch.nan)
        return output._replace(shown={"Inverse depth, input of the network": seen, **output.shown})

    def estimate(self, image: Tensor, depth: Tensor) -> MethodOutput:
        """From a picture ``[B, 3, H, W]``, about zero mean and unit variance, and inverse depth ``[B, 1, H, W]``."""
        raise NotImplementedError

    def losses(self, output: MethodOutput, inputs: NetworkInputs, target: Target) -> MethodLosses:
        """The loss that the method is trained with."""
        raise NotImplementedError


def output_layer(inputs: int, outputs: int) -> nn.Linear:
    """The last layer of all of them: so small at first that an untrained network corrects next to nothing."""
    layer = nn.Linear(inputs, outputs)
    nn.init.normal_(layer.weight, std=1e-3)
    nn.init.zeros_(layer.bias)
    return layer


def fitted_image(inputs: NetworkInputs, height: int, width: int) -> Tensor:
    """The batch's pictures at a network's fixed size, the aspect not kept: ``[B, 3, height, width]``."""
    image = F.interpolate(inputs.image.float(), (height, width), mode="bilinear", align_corners=False)
    return image_channels(image)


def fitted_depth(inputs: NetworkInputs, height: int, width: int) -> Tensor:
    """The depth maps at a network's fixed size as inverse depth ``[B, 1, height, width]``; the nearest point wins.

    The rows that `calibnet.network.batch.Cut` left out of the scan's side are there again, and empty.
    """
    inverse = inverse_depth(inputs.lidar[:, 0].float())  # [B, H', W]
    batch, rows, columns = inverse.shape
    full = inputs.image.shape[2]
    row = torch.arange(full - rows, full, device=inverse.device)
    column = torch.arange(columns, device=inverse.device)
    # where pixels' centres land: their edges are scaled
    index = ((row + 0.5) * height / full).long()[:, None] * width + ((column + 0.5) * width / columns).long()
    flat = inverse.new_zeros(batch, height * width)
    flat.scatter_reduce_(1, index.flatten().expand(batch, -1), inverse.flatten(1), "amax")
    return flat.view(batch, 1, height, width)


def scaled_pose(translation: Tensor, rotation: Tensor, range_: MiscalibrationRange) -> Tensor:
    """The correction ``[B, 4, 4]`` of regressed numbers, in units of the range.

    The papers regress metres and quaternions, in whatever scale the last layer learns; here 1 is the range's limit, so
    that an untrained network, whose outputs are small, corrects little, and all ranges train alike.

    Args:
        translation: ``[B, 3]``, 1 = the largest offset.
        rotation: ``[B, 4]``, what is added to the quaternion of no rotation (w, x, y, z); 1 = the largest angle.
        range_: of the network.
    """
    half_angle = torch.deg2rad(torch.tensor(range_.rotation_deg / 2)).to(rotation)
    identity = rotation.new_tensor([1.0, 0.0, 0.0, 0.0])
    quaternion = identity + half_angle * rotation.float()
    return rigid(rotation_from_quaternion(quaternion), translation.float() * range_.translation_m)
