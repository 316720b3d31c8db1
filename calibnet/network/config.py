"""The configuration of a network, read from the TOML file of a preset."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from importlib import resources
from typing import Annotated, Any, ClassVar, Literal, TypeAlias

from annotated_types import Interval, Len

from calibnet.errors import ConfigError
from calibnet.network.heads import HEADS
from calibnet.runtime.reading import parse_toml
from calibnet.runtime.schema import validated

Head: TypeAlias = str
"""A name in `calibnet.network.heads.HEADS`."""
Pixels = Annotated[int, Interval(ge=32, le=4096)]
Channels = Annotated[int, Interval(ge=1, le=1024)]
Few = Annotated[int, Interval(ge=0, le=8)]
Normalization = Literal["group", "batch"]
ImageEncoder = Literal["own", "efficientnet-lite0"]


@dataclass(frozen=True)
class NetworkConfig:
    """Sizes and switches of one network; every field is a key of a preset's TOML.

    The five booleans at the end are the rows of the paper's ablation (its last table). The bounds are far beyond
    what anybody would train, and keep a file from asking for a network that fits into no memory.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = {"extra": "forbid"}

    name: str
    input_height: Pixels  # other aspect ratios keep the area
    input_width: Pixels
    share_extractor: bool  # image and LiDAR depth run through the same trunk (the paper's arithmetic)
    share_image_branch: bool  # all stages use one image branch, computed once a frame
    widths: Annotated[tuple[Channels, ...], Len(1, 6)]  # channels at 1/2, 1/4, 1/8, 1/16, 1/32
    blocks: Annotated[tuple[Few, ...], Len(1, 6)]  # residual blocks at each of these
    feature_channels: Channels  # channels of the features that are matched
    normalization: Normalization
    scales: tuple[int, ...]  # strides of the cost volumes, fine to coarse, each twice the one before
    radius: Annotated[int, Interval(ge=2, le=16)]  # of the search window, in cells, the same at every scale
    groups: Channels  # of the group-wise correlation
    concat_channels: Annotated[int, Interval(ge=0, le=256)]  # of each branch in the concatenation volume
    volume_channels: Channels | tuple[Channels, ...]  # of the 3-D hourglasses: the same at all scales, or one a scale
    hourglass_blocks: Few | tuple[Few, ...]  # pairs of 3-D convolutions at each scale: the same, or one a hourglass
    hourglasses: Few  # one after the other
    convolve_finest: bool  # 3-D convolutions at the finest scale as well, which holds most of their work
    context_channels: Channels  # of the 2-D network that turns volumes into displacements
    head: Head
    image_encoder: ImageEncoder = "own"  # or one that starts from ImageNet instead of from nothing
    multi_scale_features: bool = True
    multi_scale_volumes: bool = True
    aggregation: bool = True
    hierarchical_fusion: bool = True
    hybrid_loss: bool = True

    def __post_init__(self) -> None:
        if self.head not in HEADS:
            raise ConfigError(f"Preset {self.name!r}: head must be one of {', '.join(HEADS.names())}.")
        for wrong, message in (
            (len(self.widths) != len(self.blocks), "widths and blocks must have the same length"),
            (not self.scales, "there must be at least one scale"),
            (
                any(coarse != 2 * fine for fine, coarse in itertools.pairwise(self.scales)),
                "each scale must be twice the previous one",
            ),
            (
                not set(self.scales) <= {2 ** (level + 1) for level in range(len(self.widths))},
                f"scales must be powers of two from 2 to {2 ** len(self.widths)} for {len(self.widths)} widths",
            ),
            (
                self.radius < 2 or self.radius % 2 != 0,
                "the radius must be even and at least 2, so that windows align across scales",
            ),
            (self.feature_channels % self.groups != 0, "groups must divide feature_channels"),
            (self.hourglasses < 1, "there must be at least one hourglass; switch `aggregation` off instead"),
            (
                len(_each(self.volume_channels, len(self.scales))) != len(self.scales),
                "volume_channels must have one value per scale",
            ),
            (
                len(_each(self.hourglass_blocks, self.hourglasses)) != self.hourglasses,
                "hourglass_blocks must have one value per hourglass",
            ),
            (
                self.image_encoder != "own" and self.share_extractor,
                "share_extractor must be false with a pretrained image_encoder, which takes only images",
            ),
            (
                self.image_encoder != "own" and len(self.widths) < 4,
                "there must be at least four widths with a pretrained image_encoder, which has four levels",
            ),
        ):
            if wrong:
                raise ConfigError(f"Preset {self.name!r}: {message}.")

    @property
    def trains_features(self) -> bool:
        """Whether some batches train the features alone; without the hybrid loss there are only losses of the pose."""
        return self.hybrid_loss

    @property
    def volume_scales(self) -> tuple[int, ...]:
        """Strides at which volumes are built: only the finest without multi-scale volumes."""
        return self.scales if self.multi_scale_volumes else self.scales[:1]

    @property
    def channels_at_scales(self) -> tuple[int, ...]:
        """Channels of the hourglasses at each of ``volume_scales``."""
        return _each(self.volume_channels, len(self.scales))[: len(self.volume_scales)]

    @property
    def blocks_of_hourglasses(self) -> tuple[int, ...]:
        """Blocks of each hourglass; without `aggregation`, a row of the paper's ablation, the last one is left out."""
        return _each(self.hourglass_blocks, self.hourglasses)[: self.hourglasses - (not self.aggregation)]

    @property
    def window(self) -> int:
        """Side of the search window, in cells."""
        return 2 * self.radius + 1


def _each(value: int | tuple[int, ...], number: int) -> tuple[int, ...]:
    return (value,) * number if isinstance(value, int) else value


def parse_config(values: dict[str, Any], origin: str) -> NetworkConfig:
    """Build a config from the values of a file; ``ConfigError`` names the first that is wrong, unknown or missing."""
    return validated(NetworkConfig, values, origin, ConfigError, "compare it with the presets of this version")


def preset_names() -> list[str]:
    """Names of the presets that ship with the package."""
    folder = resources.files("calibnet.network") / "presets"
    return sorted(entry.name.removesuffix(".toml") for entry in folder.iterdir() if entry.name.endswith(".toml"))


def load_preset(name: str) -> NetworkConfig:
    """Read a shipped preset; ``ConfigError`` lists those that exist."""
    if name not in preset_names():
        raise ConfigError(f"{name!r} is not a preset; choose from {', '.join(preset_names())}.")
    text = (resources.files("calibnet.network") / "presets" / f"{name}.toml").read_text(encoding="utf-8")
    return parse_config({"name": name, **parse_toml(text)}, f"Preset {name!r}")
