"""From aggregated volumes to a dense displacement field with its uncertainty."""

from __future__ import annotations

from typing import NamedTuple

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from calibnet.network.channels import PIXEL_SCALE, inverse_depth
from calibnet.network.config import NetworkConfig
from calibnet.network.convolution import Conv2d
from calibnet.network.layers import ConvBlock


class DisplacementField(NamedTuple):
    """Where each LiDAR cell of the finest scale is found in the image.

    Attributes:
        displacement: ``[B, 2, h, w]`` float32, ``(dx, dy)`` in input pixels.
        log_scale: ``[B, 2, h, w]`` float32, logarithm of the expected absolute error in pixels,
            per axis: on a vertical pole x is certain and y is not.
        features: ``[B, C, h, w]``, what the field was read from; input of the regression head.
    """

    displacement: Tensor
    log_scale: Tensor
    features: Tensor


def expected_error(field: DisplacementField, cells: Tensor) -> Tensor:
    """The match error, in input pixels, that the network expects of each frame: geometric mean over cells and axes.

    It is large if image and scan do not belong together, since then nothing is matched with confidence.

    Args:
        field: displacement field of a batch.
        cells: ``[B, 3, h, w]`` nearest LiDAR point of each cell, zeros where there is none.

    Returns:
        ``[B]``; NaN if no cell holds a point.
    """
    occupied = (cells[:, 2] > 0).float()
    logarithms = field.log_scale.float().mean(1) * occupied
    return (logarithms.sum((1, 2)) / occupied.sum((1, 2))).exp()


def window_offsets(radius: int, stride: int, device: torch.device) -> Tensor:
    """The displacements of the flattened window, ``[D, 2]`` on a device: ``(dx, dy)`` in input pixels."""
    axis = torch.arange(-radius, radius + 1, dtype=torch.float32, device=device) * stride
    dy, dx = torch.meshgrid(axis, axis, indexing="ij")
    return torch.stack([dx, dy], dim=-1).reshape(-1, 2)


class DisplacementDecoder(nn.Module):
    """Soft-argmax at every scale, blended cell by cell, plus a convolutional residual."""

    LOG_SCALE_BOUNDS = (-2.5, 4.5)  # 0.08 to 90 px

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        self.config = config
        self.scales = config.volume_scales
        width, norm = config.context_channels, config.normalization
        inputs = config.window**2 + 3 * len(self.scales) + config.feature_channels + 2
        self.context = nn.Sequential(
            ConvBlock(inputs, width, norm),
            ConvBlock(width, width, norm, dilation=2),
            ConvBlock(width, width, norm, dilation=4),
            ConvBlock(width, width, norm),
        )
        self.blend = Conv2d(width, len(self.scales), 3, padding=1)
        self.residual = Conv2d(width, 2, 3, padding=1)
        self.log_scale = Conv2d(width, 2, 3, padding=1)
        nn.init.zeros_(self.residual.weight)
        nn.init.zeros_(self.log_scale.weight)
        assert self.log_scale.bias is not None
        nn.init.constant_(self.log_scale.bias, 2.0)  # start unsure: about 7 px

    def forward(self, logits: list[Tensor], lidar_features: Tensor, cells: Tensor) -> DisplacementField:
        """Decode the field.

        Args:
            logits: ``[B, D, h_s, w_s]`` over the window, fine to coarse.
            lidar_features: ``[B, C, h, w]`` of the finest scale.
            cells: ``[B, 3, h, w]`` nearest LiDAR point of each cell, zeros where there is none.
        """
        size = lidar_features.shape[-2:]
        expected, peaks = [], []
        probabilities = [scale_logits.float().softmax(1) for scale_logits in logits]
        for stride, weights in zip(self.scales, probabilities, strict=True):
            offsets = window_offsets(self.config.radius, stride, weights.device)
            mean = torch.einsum("bdhw,dc->bchw", weights, offsets)
            peak = weights.amax(1, keepdim=True)
            if stride != self.scales[0]:
                mean = F.interpolate(mean, size=size, mode="bilinear", align_corners=False)
                peak = F.interpolate(peak, size=size, mode="bilinear", align_corners=False)
            expected.append(mean)
            peaks.append(peak)
        depth = cells[:, 2:]
        parts = [
            probabilities[0] * 4.0,
            torch.cat(expected, dim=1) / PIXEL_SCALE,
            *peaks,
            lidar_features,
            (depth > 0).float(),
            inverse_depth(depth),
        ]
        inputs = torch.cat([part.to(lidar_features.dtype) for part in parts], dim=1)
        features = self.context(inputs.contiguous(memory_format=torch.channels_last))
        blend = self.blend(features).float().softmax(1)
        candidates = torch.stack(expected, dim=1)  # [B, S, 2, h, w]
        displacement = (blend[:, :, None] * candidates).sum(1) + self.residual(features).float() * self.scales[0]
        log_scale = self.log_scale(features).float().clamp(*self.LOG_SCALE_BOUNDS)
        return DisplacementField(displacement, log_scale, features)
