"""What goes into the networks: image and scan as channels of about unit size."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor

IMAGE_CHANNELS = 3
LIDAR_CHANNELS = 6
INVERSE_DEPTH_SCALE_M = 4.0
"""Factor on inverse depths, which are 1 at this depth, metres."""
NEAREST_M = 1.0
"""Smaller depths are raised to this, metres, before they are inverted."""
PIXEL_SCALE = 32.0
"""Displacements in input pixels are divided by this where they are channels."""


def compute_dtype(inputs: Tensor) -> torch.dtype:
    """The precision in which convolutions of ``inputs`` compute; their input needs no finer one."""
    kind = inputs.device.type
    mixed = kind != "meta" and torch.is_autocast_enabled(kind)  # meta, used to count parameters, has none
    return torch.get_autocast_dtype(kind) if mixed else torch.float32


def image_channels(image: Tensor) -> Tensor:
    """RGB 0..255 ``[B, 3, H, W]`` (any dtype) to about zero mean and unit variance.

    In bf16 grey values and their differences from 110 are exact, so this equals the rounded result.
    """
    return (image.to(compute_dtype(image)) - 110.0) / 65.0


def inverse_depth(depth: Tensor) -> Tensor:
    """Depths in metres to inverse depths, 0 where there is none: nearly linear in the pixel shift of a translation."""
    return (depth > 0).float() * (INVERSE_DEPTH_SCALE_M / depth.clamp(min=NEAREST_M))


def lidar_channels(lidar: Tensor) -> Tensor:
    """Sparse depth (metres, 0 = empty) and intensity ``[B, 2, H, W]`` to network input ``[B, 6, H, W]``.

    The two dilated copies of the inverse depth (nearest wins) make 16 beams look more like 64, so that one network
    serves both.
    """
    precision = compute_dtype(lidar)  # rounding keeps the order, so maxima stay the same
    depth, intensity = lidar[:, :1].float(), lidar[:, 1:].float()
    occupied = (depth > 0).float()
    inverse = inverse_depth(depth).to(precision)
    logarithm = occupied * (depth.clamp(min=NEAREST_M).log() * 0.5 - 1.0)
    near = dilate(dilate(inverse, 2, dim=2), 1, dim=3)
    wide = dilate(dilate(near, 3, dim=2), 2, dim=3)
    channels = [inverse, logarithm, occupied, intensity * occupied, near, wide]
    return torch.cat([channel.to(precision) for channel in channels], dim=1)


def dilate(x: Tensor, radius: int, dim: int) -> Tensor:
    """Maximum over ``2 * radius + 1`` neighbours of non-negative numbers along one axis.

    Maxima of shifted copies, which reach twice as far with every step: `max_pool2d` takes ten times as long on a CPU,
    since it finds indices too.
    """
    x = F.pad(x, [0, 0, radius, radius] if dim == 2 else [radius, radius, 0, 0])
    reach, full = 1, 2 * radius + 1
    while reach < full:
        shift = min(reach, full - reach)
        size = x.shape[dim] - shift
        x = torch.maximum(x.narrow(dim, 0, size), x.narrow(dim, shift, size))
        reach += shift
    return x
