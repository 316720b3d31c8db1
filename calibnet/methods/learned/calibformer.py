"""After CalibFormer (Xiao, Li, Meng, Li, Ji, Zhang, ICRA 2024), of which only the abstract is public.

From the abstract: layers of image and depth features are aggregated to a fine resolution and correlated by several
heads, and a transformer estimates the pose from the correlation. All else is ours, and its figures are not
CalibFormer's: two ResNet-18 whose levels from 1/8 to 1/32 are summed at 1/8; eight heads, each the cosine of its share
of the channels with a window of 4 cells around; three convolutions to tokens at 1/32, with position embeddings;
four encoder layers; two decoder layers with a query for the translation and one for the rotation. The loss is
LCCNet's without the points: smooth L1 of the translation and the quaternions' distance.
"""

from __future__ import annotations

from typing import Any

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from calibnet.geometry import MiscalibrationRange
from calibnet.methods.learned.config import MethodConfig
from calibnet.methods.learned.losses import angles, method_losses, smooth_offset
from calibnet.methods.learned.network import MethodLosses, MethodNetwork, MethodOutput, output_layer, scaled_pose
from calibnet.methods.learned.resnet import ResNet18
from calibnet.network.batch import NetworkInputs
from calibnet.network.cost_volume import correlate
from calibnet.network.target import Target

FEATURES = 128
HEADS = 8
"""Heads of the correlation and of the attention."""
RADIUS = 4
WIDTH = 256
ENCODER, DECODER = 4, 2
STRIDE = 32
TRANSLATION, ROTATION = 2.0, 1.0


class FineFeatures(nn.Module):
    """A ResNet-18 whose levels are brought to 1/8 and summed: ``[B, inputs, H, W] -> [B, 128, H/8, W/8]``."""

    def __init__(self, inputs: int) -> None:
        super().__init__()
        self.encoder = ResNet18(inputs)
        self.lateral = nn.ModuleList(nn.Conv2d(width, FEATURES, 1) for width in self.encoder.widths[1:])
        self.smooth = nn.Sequential(
            nn.Conv2d(FEATURES, FEATURES, 3, padding=1, bias=False), nn.BatchNorm2d(FEATURES), nn.ReLU(inplace=True)
        )
        self.project = nn.Conv2d(FEATURES, FEATURES, 1)

    def forward(self, x: Tensor) -> Tensor:
        """The features, see the class."""
        levels = [lateral(level) for lateral, level in zip(self.lateral, self.encoder(x)[1:], strict=True)]
        size = levels[0].shape[2:]
        summed = levels[0]
        for level in levels[1:]:
            summed = summed + F.interpolate(level, size, mode="bilinear", align_corners=False)
        features: Tensor = self.project(self.smooth(summed))
        return features


class CalibFormer(MethodNetwork):
    """Image and depth to translation and quaternion through correlation and attention."""

    NAME = "calibformer"

    def __init__(self, config: MethodConfig, range_: MiscalibrationRange) -> None:
        super().__init__(config, range_)
        self.picture, self.depth = FineFeatures(3), FineFeatures(1)
        self.tokens = nn.Sequential(
            nn.Conv2d(HEADS * (2 * RADIUS + 1) ** 2, WIDTH, 1),
            nn.ReLU(inplace=True),
            nn.Conv2d(WIDTH, WIDTH, 3, 2, 1),
            nn.ReLU(inplace=True),
            nn.Conv2d(WIDTH, WIDTH, 3, 2, 1),
        )
        cells = (config.input_height // STRIDE) * (config.input_width // STRIDE)
        self.place = nn.Parameter(0.02 * torch.randn(cells, WIDTH))
        self.queries = nn.Parameter(0.02 * torch.randn(2, WIDTH))
        options: dict[str, Any] = {
            "dim_feedforward": 2 * WIDTH,
            "dropout": 0.0,
            "batch_first": True,
            "norm_first": True,
        }
        # one module per layer: nn.TransformerEncoder's fast path would compute otherwise than in training
        self.encoder = nn.ModuleList(nn.TransformerEncoderLayer(WIDTH, HEADS, **options) for _ in range(ENCODER))
        self.decoder = nn.ModuleList(nn.TransformerDecoderLayer(WIDTH, HEADS, **options) for _ in range(DECODER))
        self.norm = nn.LayerNorm(WIDTH)
        self.translation, self.rotation = output_layer(WIDTH, 3), output_layer(WIDTH, 4)

    def estimate(self, image: Tensor, depth: Tensor) -> MethodOutput:
        """See `MethodNetwork.estimate`; ``regressed`` is translation and quaternion, units of the range, ``[B, 7]``."""
        picture, scan = self.picture(image), self.depth(depth)
        volume = correlate(by_head(scan), by_head(picture), RADIUS, HEADS)  # [B, Dy, Dx, h, w, heads]
        heads = volume.permute(0, 5, 1, 2, 3, 4)
        tokens = self.tokens(heads.flatten(1, 3)).flatten(2).transpose(1, 2) + self.place
        for layer in self.encoder:
            tokens = layer(tokens)
        answers = self.queries.repeat(len(tokens), 1, 1)
        for layer in self.decoder:
            answers = layer(answers, tokens)
        answers = self.norm(answers)
        translation, rotation = self.translation(answers[:, 0]).float(), self.rotation(answers[:, 1]).float()
        shown = {
            "Image features": picture.abs().mean(1),
            "Depth features": scan.abs().mean(1),
            "Correlation, best in the window": heads.mean(1).flatten(1, 2).amax(1),
        }
        regressed = torch.cat([translation, rotation], dim=-1)
        return MethodOutput(scaled_pose(translation, rotation, self.range), regressed, shown)

    def losses(self, output: MethodOutput, inputs: NetworkInputs, target: Target) -> MethodLosses:
        """Weighted errors of translation and rotation."""
        estimate, truth = output.correction, target.correction
        return method_losses(
            estimate,
            truth,
            translation=TRANSLATION * smooth_offset(estimate, truth),
            rotation=ROTATION * angles(estimate, truth).mean(),
        )


def by_head(features: Tensor) -> Tensor:
    """Normalise features ``[B, C, h, w]`` so that each head's share of the channels has unit length."""
    return F.normalize(features.unflatten(1, (HEADS, -1)), dim=2).flatten(1, 2)
