"""Multi-scale features of the image and of the LiDAR depth (paper section 3.1): a U-Net pyramid."""

from __future__ import annotations

from collections.abc import Sequence

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from calibnet.network import efficientnet
from calibnet.network.config import NetworkConfig
from calibnet.network.convolution import Conv2d
from calibnet.network.layers import ConvBlock, ResidualBlock

IMAGE_CHANNELS = 3
LIDAR_CHANNELS = 6


def image_channels(image: Tensor) -> Tensor:
    """RGB 0..255 ``[B, 3, H, W]`` (any dtype) to about zero mean and unit variance.

    In bf16 a grey value and its difference are exact, so that this is what rounding the result would give.
    """
    return (image.to(convolved_in(image)) - 110.0) / 65.0


def convolved_in(inputs: Tensor) -> torch.dtype:
    """The precision that convolutions of ``inputs`` compute in: what goes into them need not be finer."""
    kind = inputs.device.type
    mixed = kind != "meta" and torch.is_autocast_enabled(kind)  # what is only counted has no autocast
    return torch.get_autocast_dtype(kind) if mixed else torch.float32


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


def lidar_channels(lidar: Tensor) -> Tensor:
    """Sparse depth (metres, 0 = empty) and intensity ``[B, 2, H, W]`` to network input ``[B, 6, H, W]``.

    Inverse depth is nearly linear in the pixel shift that a translation causes. The two dilated
    copies (nearest wins) make 16 beams look more like 64, so that one network serves both.
    """
    precision = convolved_in(lidar)  # of two rounded numbers the same is the larger
    depth, intensity = lidar[:, :1].float(), lidar[:, 1:].float()
    occupied, at_least_one = (depth > 0).float(), depth.clamp(min=1.0)
    inverse = (occupied * (4.0 / at_least_one)).to(precision)
    logarithm = occupied * (at_least_one.log() * 0.5 - 1.0)
    near = dilate(dilate(inverse, 2, dim=2), 1, dim=3)
    wide = dilate(dilate(near, 3, dim=2), 2, dim=3)
    channels = [inverse, logarithm, occupied, intensity * occupied, near, wide]
    return torch.cat([channel.to(precision) for channel in channels], dim=1)


class Trunk(nn.Module):
    """Encoder from 1/2 to 1/32 and decoder back to the finest scale of the cost volumes.

    Without multi-scale features, a row of the paper's ablation, the encoder is whole and only its last level is read,
    resampled to each scale (docs/decisions.md, "The paper's ablation").

    The encoder's finer levels may be those of another network, the ``pretrained`` ones, which start at the image;
    ours start behind a stem.
    """

    def __init__(self, config: NetworkConfig, pretrained: Sequence[nn.Module] = (), their_widths: Sequence[int] = ()):
        super().__init__()
        self.config = config
        norm, widths = config.normalization, [*their_widths, *config.widths[len(their_widths) :]]
        strides = [2 ** (level + 1) for level in range(len(widths))]
        self.levels = [strides.index(scale) for scale in config.scales]
        deepest = self.levels[-1]
        own = (
            nn.Sequential(
                *([ConvBlock(widths[level - 1], width, norm, stride=2)] if level else []),
                *(ResidualBlock(width, norm) for _ in range(blocks)),
            )
            for level, (width, blocks) in enumerate(zip(widths, config.blocks, strict=True))
            if level >= len(pretrained)
        )
        self.encoder = nn.ModuleList([*pretrained, *own][: deepest + 1])
        self.pretrained = min(len(pretrained), deepest + 1)
        features = config.feature_channels
        if config.multi_scale_features:
            self.lateral = nn.ModuleList(Conv2d(widths[level], features, 1) for level in self.levels)
            self.smooth = nn.ModuleList(ConvBlock(features, features, norm) for _ in self.levels)
        else:
            self.lateral = nn.ModuleList([Conv2d(widths[deepest], features, 1)])
        self.project = nn.ModuleList(Conv2d(features, features, 1) for _ in config.volume_scales)

    def forward(self, x: Tensor) -> list[Tensor]:
        """Stem or image to features ``[B, C, H/s, W/s]``, one per volume, fine to coarse."""
        encoded = []
        for stage in self.encoder:
            x = stage(x)
            encoded.append(x)
        if not self.config.multi_scale_features:
            coarsest = self.lateral[0](encoded[-1])
            factors = [self.config.scales[-1] // scale for scale in self.config.volume_scales]
            resampled = (
                F.interpolate(coarsest, scale_factor=float(factor), mode="bilinear") if factor > 1 else coarsest
                for factor in factors
            )
            return [project(feature) for project, feature in zip(self.project, resampled, strict=True)]
        features: list[Tensor] = []
        for position in reversed(range(len(self.levels))):
            merged = self.lateral[position](encoded[self.levels[position]])
            if features:
                merged = merged + F.interpolate(features[0], scale_factor=2.0, mode="nearest")
            features.insert(0, self.smooth[position](merged))
        return [project(feature) for project, feature in zip(self.project, features, strict=False)]


class FeatureExtractor(nn.Module):
    """Stems for the two inputs and the trunk, one or two of it."""

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        if config.image_encoder == "efficientnet-lite0":
            self.image_stem: nn.Module = nn.Identity()
            self.image_trunk = Trunk(config, efficientnet.efficientnet_levels(), efficientnet.WIDTHS)
        else:
            self.image_stem = ConvBlock(IMAGE_CHANNELS, config.widths[0], config.normalization, stride=2)
            self.image_trunk = Trunk(config)
        self.lidar_stem = ConvBlock(LIDAR_CHANNELS, config.widths[0], config.normalization, stride=2)
        self.lidar_trunk = self.image_trunk if config.share_extractor else Trunk(config)

    def pretrained_levels(self) -> nn.ModuleList:
        """The levels of the image branch that have weights from elsewhere; none if the image encoder is our own."""
        return self.image_trunk.encoder[: self.image_trunk.pretrained]

    def load_pretrained(self) -> None:
        """Give those levels their weights."""
        if levels := self.pretrained_levels():
            state = efficientnet.load_weights()
            levels.load_state_dict({name: state[name] for name in levels.state_dict()})

    def image(self, image: Tensor) -> list[Tensor]:
        """RGB 0..255 ``[B, 3, H, W]`` to features ``[B, C, H/s, W/s]``, fine to coarse."""
        x = image_channels(image).contiguous(memory_format=torch.channels_last)
        return self.image_trunk(self.image_stem(x))

    def lidar(self, lidar: Tensor) -> list[Tensor]:
        """Depth and intensity ``[B, 2, H, W]`` to features ``[B, C, H/s, W/s]``, fine to coarse."""
        x = lidar_channels(lidar).contiguous(memory_format=torch.channels_last)
        return self.lidar_trunk(self.lidar_stem(x))
