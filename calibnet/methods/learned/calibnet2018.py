"""CalibNet (Iyer, Ram, Murthy, Krishna, IROS 2018), not to be confused with this package: geometric supervision alone.

From the paper: a ResNet-18 for the image and one of half the channels for the depth map, whose sparse points are
spread by max pooling; their features are concatenated and aggregated by convolutions; the output is decoupled, a
branch for the translation and one for the rotation, as a vector in so(3). The true pose is no target in training:
the loss compares depth maps (photometric) and clouds of points, both moved by the estimate and by the truth. The
trained network runs several times, each time on the scan projected anew.

Ours: among the cloud distances that the paper tries, the Chamfer distance, of the nearest points of every 16 x 16
pixels; depth maps of inverse depth at 1/8, with each point spread over four cells, as single pixels have no gradient;
the weights of the two terms; three looks; outputs in units of the range.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn

from calibnet.geometry import MiscalibrationRange
from calibnet.methods.learned.config import MethodConfig
from calibnet.methods.learned.losses import chamfer_distance, method_losses, photometric_error
from calibnet.methods.learned.network import MethodLosses, MethodNetwork, MethodOutput, output_layer
from calibnet.methods.learned.resnet import ResNet18
from calibnet.network.batch import NetworkInputs
from calibnet.network.pose import rigid, rotation_from_vector
from calibnet.network.target import Target

AGGREGATED = (512, 512)
BRANCH = 256
HIDDEN = 512
POOLED = (2, 4)
"""Size to which a branch is pooled before its fully connected layers."""
DROPOUT = 0.3
PHOTOMETRIC, POINTS = 1.0, 0.5


class CalibNet2018(MethodNetwork):
    """Image and depth to translation and rotation vector."""

    NAME, LOOKS, POOLING, LEARNING_RATE = "calibnet", 3, 5, 5e-4

    def __init__(self, config: MethodConfig, range_: MiscalibrationRange) -> None:
        super().__init__(config, range_)
        self.picture, self.depth = ResNet18(3), ResNet18(1, share=0.5)
        width = self.picture.widths[-1] + self.depth.widths[-1]
        self.aggregation = nn.Sequential(
            *convolution(width, AGGREGATED[0], stride=2), *convolution(AGGREGATED[0], AGGREGATED[1])
        )
        self.translation, self.rotation = branch(AGGREGATED[1]), branch(AGGREGATED[1])

    def estimate(self, image: Tensor, depth: Tensor) -> MethodOutput:
        """See `MethodNetwork.estimate`; ``regressed`` is translation and rotation in units of the range, ``[B, 6]``."""
        picture, scan = self.picture(image)[-1], self.depth(depth)[-1]
        aggregated = self.aggregation(torch.cat([picture, scan], dim=1))
        translation, rotation = self.translation(aggregated).float(), self.rotation(aggregated).float()
        turn = rotation_from_vector(math.radians(self.range.rotation_deg) * rotation)
        shown = {
            "Image features": picture.abs().mean(1),
            "Depth features": scan.abs().mean(1),
            "Aggregated": aggregated.abs().mean(1),
        }
        correction = rigid(turn, self.range.translation_m * translation)
        return MethodOutput(correction, torch.cat([translation, rotation], dim=-1), shown)

    def losses(self, output: MethodOutput, inputs: NetworkInputs, target: Target) -> MethodLosses:
        """Differences of depth maps and clouds under the estimate and under the truth."""
        estimate, truth = output.correction, target.correction
        stride = self.config.scales[0]
        return method_losses(
            estimate,
            truth,
            points=POINTS * chamfer_distance(estimate, truth, inputs.cells[1]),
            photometric=PHOTOMETRIC * photometric_error(estimate, truth, inputs, stride),
        )


def convolution(inputs: int, outputs: int, stride: int = 1) -> list[nn.Module]:
    """A 3x3 convolution with batch normalisation and ReLU."""
    return [
        nn.Conv2d(inputs, outputs, 3, stride, 1, bias=False),
        nn.BatchNorm2d(outputs),
        nn.ReLU(inplace=True),
    ]


def branch(inputs: int) -> nn.Sequential:
    """One of the two outputs, ``[B, inputs, h, w] -> [B, 3]``."""
    return nn.Sequential(
        *convolution(inputs, BRANCH),
        nn.AdaptiveAvgPool2d(POOLED),
        nn.Flatten(),
        nn.Linear(BRANCH * POOLED[0] * POOLED[1], HIDDEN),
        nn.ReLU(inplace=True),
        nn.Dropout(DROPOUT),
        output_layer(HIDDEN, 3),
    )
