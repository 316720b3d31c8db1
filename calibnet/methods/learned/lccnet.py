"""LCCNet (Lv, Wang, Dou, Ye, Wang, CVPRW 2021): two ResNet-18, their correlation at 1/32, fully connected heads.

From the paper: a ResNet-18 for the image and one for the depth map; correlation within 4 cells at 1/32;
five densely connected convolutions; a fully connected layer of 512 and two branches of 256
for translation and quaternion. Loss: smooth L1 of the translation, quaternion distance, and the mean distance of
the scan's points, half and half. Five such networks, of ever narrower ranges, run one after the other.

The published code has layers that its forward pass does not use; they are left out here: 58 M parameters. Ours: the
input is inverse depth, as for all methods here; both outputs are in units of the range, see
`calibnet.methods.learned.network.scaled_pose`; points are the nearest of every 8 x 8 pixels.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from calibnet.geometry import MiscalibrationRange
from calibnet.methods.learned.config import MethodConfig
from calibnet.methods.learned.losses import angles, method_losses, point_distance, smooth_offset
from calibnet.methods.learned.network import MethodLosses, MethodNetwork, MethodOutput, output_layer, scaled_pose
from calibnet.methods.learned.resnet import ResNet18
from calibnet.network.batch import NetworkInputs
from calibnet.network.cost_volume import correlate
from calibnet.network.target import Target

RADIUS = 4
DENSE = (128, 128, 96, 64, 32)
HIDDEN = 512
BRANCH = 256
LEAK = 0.1
STRIDE = 32
TRANSLATION, ROTATION, POINTS = 2.0, 1.0, 0.5
"""Weights of translation and rotation in the pose loss, and the share of the points' distance in the loss."""


class LCCNet(MethodNetwork):
    """Image and depth to translation and quaternion through a correlation volume."""

    NAME, CASCADED = "lccnet", True

    def __init__(self, config: MethodConfig, range_: MiscalibrationRange) -> None:
        super().__init__(config, range_)
        self.picture, self.depth = ResNet18(3), ResNet18(1)
        self.leak = nn.LeakyReLU(LEAK)
        channels = (2 * RADIUS + 1) ** 2
        self.dense = nn.ModuleList()
        for width in DENSE:
            self.dense.append(nn.Sequential(nn.Conv2d(channels, width, 3, padding=1), nn.LeakyReLU(LEAK)))
            channels += width
        cells = (config.input_height // STRIDE) * (config.input_width // STRIDE)
        self.hidden = nn.Sequential(nn.Flatten(), nn.Linear(channels * cells, HIDDEN), nn.LeakyReLU(LEAK))
        self.translation, self.rotation = branch(3), branch(4)

    def estimate(self, image: Tensor, depth: Tensor) -> MethodOutput:
        """See `MethodNetwork.estimate`; ``regressed`` is translation and quaternion, units of the range, ``[B, 7]``."""
        picture, scan = self.picture(image)[-1], self.depth(depth)[-1]
        volume = correlate(scan, picture, RADIUS, groups=1)[..., 0].flatten(1, 2) / scan.shape[1]
        x = self.leak(volume)
        for layer in self.dense:
            x = torch.cat([layer(x), x], dim=1)
        hidden = self.hidden(x)
        translation, rotation = self.translation(hidden).float(), self.rotation(hidden).float()
        shown = {
            "Image features": picture.abs().mean(1),
            "Depth features": scan.abs().mean(1),
            "Correlation, best in the window": volume.amax(1),
        }
        regressed = torch.cat([translation, rotation], dim=-1)
        return MethodOutput(scaled_pose(translation, rotation, self.range), regressed, shown)

    def losses(self, output: MethodOutput, inputs: NetworkInputs, target: Target) -> MethodLosses:
        """The paper's loss: the error of the pose and the distance of the points, half each."""
        estimate, truth = output.correction, target.correction
        share = 1 - POINTS
        return method_losses(
            estimate,
            truth,
            translation=share * TRANSLATION * smooth_offset(estimate, truth),
            rotation=share * ROTATION * angles(estimate, truth).mean(),
            points=POINTS * point_distance(estimate, truth, inputs.cells[0]),
        )


def branch(outputs: int) -> nn.Sequential:
    """The fully connected layers of one of the two outputs, ``[B, 512] -> [B, outputs]``."""
    return nn.Sequential(nn.Linear(HIDDEN, BRANCH), nn.LeakyReLU(LEAK), output_layer(BRANCH, outputs))
