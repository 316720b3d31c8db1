"""Multi-scale features of the image and of the LiDAR depth (paper section 3.1): a U-Net pyramid for each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from calibnet.network import efficientnet
from calibnet.network.batch import NetworkInputs
from calibnet.network.channels import IMAGE_CHANNELS, LIDAR_CHANNELS, image_channels, lidar_channels
from calibnet.network.config import NetworkConfig
from calibnet.network.convolution import Conv2d
from calibnet.network.layers import ConvBlock, ResidualBlock


class Features(NamedTuple):
    """Features of both branches, ``[B, C, H/s, W/s]`` per scale of the cost volumes, fine to coarse.

    Those of the LiDAR cover only the lowest rows of the image, see `calibnet.network.batch.Cut`.
    """

    lidar: list[Tensor]
    image: list[Tensor]


class FeatureExtractor(nn.Module):
    """A stem and a pyramid for each of the two inputs; both may share the pyramid.

    The image's pyramid may start from a network trained on ImageNet, which has a stem of its own.
    """

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        branch = FeaturePyramid if config.multi_scale_features else SingleScaleFeatures
        stem = config.widths[0], config.normalization
        pretrained: list[nn.Sequential] = []
        if config.image_encoder == "efficientnet-lite0":
            self.image_stem: nn.Module = nn.Identity()
            pretrained = efficientnet.efficientnet_levels()
        else:
            self.image_stem = ConvBlock(IMAGE_CHANNELS, *stem, stride=2)
        self.image_trunk = branch(config, pretrained)
        self.lidar_stem = ConvBlock(LIDAR_CHANNELS, *stem, stride=2)
        self.lidar_trunk = self.image_trunk if config.share_extractor else branch(config)
        self._pretrained = len(pretrained)

    def forward(self, inputs: NetworkInputs, image_features: list[Tensor] | None = None) -> Features:
        """Features of a batch; those of the image may come from an earlier call."""
        image = self.image(inputs.image) if image_features is None else image_features
        return Features(self.lidar(inputs.lidar), image)

    def image(self, image: Tensor) -> list[Tensor]:
        """RGB 0..255 ``[B, 3, H, W]`` to features ``[B, C, H/s, W/s]``, fine to coarse."""
        x = image_channels(image).contiguous(memory_format=torch.channels_last)
        return self.image_trunk(self.image_stem(x))

    def lidar(self, lidar: Tensor) -> list[Tensor]:
        """Depth and intensity ``[B, 2, H, W]`` to features ``[B, C, H/s, W/s]``, fine to coarse."""
        x = lidar_channels(lidar).contiguous(memory_format=torch.channels_last)
        return self.lidar_trunk(self.lidar_stem(x))

    def pretrained_levels(self) -> nn.ModuleList:
        """The levels of the image branch that have weights from elsewhere; none if the image encoder is our own."""
        return self.image_trunk.encoder[: self._pretrained]

    def load_pretrained(self) -> None:
        """Load the ImageNet weights into those levels."""
        if levels := self.pretrained_levels():
            state = efficientnet.load_weights()
            levels.load_state_dict({name: state[name] for name in levels.state_dict()})


class Encoder(nn.ModuleList):
    """Levels that halve their input, from 1/2 on."""

    @classmethod
    def down_to(cls, scale: int, config: NetworkConfig, pretrained: Sequence[nn.Module]) -> Encoder:
        """The levels down to 1/scale, of which the first are the ``pretrained`` ones, if there are any.

        Our own levels start behind a stem, pretrained ones at the image.
        """
        widths, norm = encoder_widths(config, pretrained), config.normalization
        own = (
            nn.Sequential(
                *([ConvBlock(widths[level - 1], widths[level], norm, stride=2)] if level else []),
                *(ResidualBlock(widths[level], norm) for _ in range(config.blocks[level])),
            )
            for level in range(len(pretrained), len(config.widths))
        )
        return cls([*pretrained, *own][: level_at(scale) + 1])

    def forward(self, x: Tensor) -> list[Tensor]:
        """The outputs of all levels, each computed from the one before."""
        encoded = []
        for level in self:
            x = level(x)
            encoded.append(x)
        return encoded


def level_at(scale: int) -> int:
    """The encoder's level at 1/scale; level 0 is at 1/2."""
    return scale.bit_length() - 2


def encoder_widths(config: NetworkConfig, pretrained: Sequence[nn.Module]) -> list[int]:
    """Channels of the encoder's levels."""
    theirs = efficientnet.WIDTHS if pretrained else ()
    return [*theirs, *config.widths[len(theirs) :]]


class FeaturePyramid(nn.Module):
    """An encoder down to the coarsest scale, and a decoder back up to the finest of the cost volumes."""

    def __init__(self, config: NetworkConfig, pretrained: Sequence[nn.Module] = ()) -> None:
        super().__init__()
        widths, features = encoder_widths(config, pretrained), config.feature_channels
        self.levels = [level_at(scale) for scale in config.scales]
        self.encoder = Encoder.down_to(config.scales[-1], config, pretrained)
        self.lateral = nn.ModuleList(Conv2d(widths[level], features, 1) for level in self.levels)
        self.smooth = nn.ModuleList(ConvBlock(features, features, config.normalization) for _ in self.levels)
        self.project = nn.ModuleList(Conv2d(features, features, 1) for _ in config.volume_scales)

    def forward(self, x: Tensor) -> list[Tensor]:
        """Stem or image to features ``[B, C, H/s, W/s]``, one per volume, fine to coarse."""
        encoded = self.encoder(x)
        features: list[Tensor] = []
        for position in reversed(range(len(self.levels))):
            merged = self.lateral[position](encoded[self.levels[position]])
            if features:
                merged = merged + F.interpolate(features[0], scale_factor=2.0, mode="nearest")
            features.insert(0, self.smooth[position](merged))
        return [project(feature) for project, feature in zip(self.project, features, strict=False)]


class SingleScaleFeatures(nn.Module):
    """Features without the pyramid: the row of the paper's ablation without multi-scale features.

    The encoder is the same, but only its last level is read, and resampled to each scale (docs/decisions.md, "The
    paper's ablation").
    """

    def __init__(self, config: NetworkConfig, pretrained: Sequence[nn.Module] = ()) -> None:
        super().__init__()
        features, coarsest = config.feature_channels, config.scales[-1]
        self.factors = [coarsest // scale for scale in config.volume_scales]
        self.encoder = Encoder.down_to(coarsest, config, pretrained)
        widths = encoder_widths(config, pretrained)
        self.lateral = nn.ModuleList([Conv2d(widths[level_at(coarsest)], features, 1)])
        self.project = nn.ModuleList(Conv2d(features, features, 1) for _ in config.volume_scales)

    def forward(self, x: Tensor) -> list[Tensor]:
        """Stem or image to features ``[B, C, H/s, W/s]``, one per volume, fine to coarse."""
        coarsest = self.lateral[0](self.encoder(x)[-1])
        resampled = (
            F.interpolate(coarsest, scale_factor=float(factor), mode="bilinear") if factor > 1 else coarsest
            for factor in self.factors
        )
        return [project(feature) for project, feature in zip(self.project, resampled, strict=True)]
