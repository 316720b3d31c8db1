"""A network small enough to run in milliseconds, and inputs for networks of any size."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import torch

from calibnet.geometry import RANGES
from calibnet.network.batch import NetworkInputs
from calibnet.network.config import NetworkConfig
from calibnet.network.network import CalibrationNetwork

TINY = NetworkConfig(
    name="tiny",
    input_height=64,
    input_width=128,
    share_extractor=False,
    share_image_branch=True,
    widths=(8, 8, 16, 16, 16),
    blocks=(0, 0, 1, 0, 0),
    feature_channels=16,
    normalization="group",
    scales=(8, 16, 32),
    radius=2,
    groups=2,
    concat_channels=2,
    volume_channels=(4, 6, 8),
    hourglass_blocks=(1, 1),
    hourglasses=2,
    convolve_finest=True,
    context_channels=16,
    head="geometric",
)


def tiny_network(seed: int = 0, stage: int = 3, **changes: Any) -> CalibrationNetwork:
    """A random network in evaluation mode."""
    torch.manual_seed(seed)
    return CalibrationNetwork(replace(TINY, **changes), RANGES[stage - 1]).eval()


def random_inputs(config: NetworkConfig, height: int = 64, width: int = 128, batch: int = 1) -> NetworkInputs:
    """Noise as image and scan: every second cell holds a point that projects into it."""
    generator = torch.Generator().manual_seed(3)
    intrinsics = torch.tensor([[0.7 * width, 0.0, width / 2], [0.0, 0.7 * width, height / 2], [0.0, 0.0, 1.0]])
    cells = []
    for scale in config.scales:
        v, u = torch.meshgrid(torch.arange(height // scale), torch.arange(width // scale), indexing="ij")
        pixel = (
            torch.stack([u * scale, v * scale, torch.ones_like(u)]).float()
            + torch.tensor([4.0, 4.0, 0.0])[:, None, None]
        )
        depth = 3.0 + 30.0 * torch.rand(batch, 1, *u.shape, generator=generator)
        depth = depth * (torch.rand(depth.shape, generator=generator) < 0.5)
        cells.append(torch.einsum("ij,jhw->ihw", torch.linalg.inv(intrinsics), pixel)[None] * depth)
    depth = 3.0 + 30.0 * torch.rand(batch, 1, height, width, generator=generator)
    depth = depth * (torch.rand(depth.shape, generator=generator) < 0.1)
    lidar = torch.cat([depth, torch.rand(depth.shape, generator=generator) * (depth > 0)], dim=1)
    image = torch.randint(0, 256, (batch, 3, height, width), generator=generator, dtype=torch.uint8)
    return NetworkInputs(image, lidar, intrinsics.expand(batch, 3, 3), cells)
