"""What a network is made of, read from the presets' TOML files."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, fields
from importlib import resources
from typing import Any, Literal

from calibnet.errors import ConfigError


@dataclass(frozen=True)
class NetworkConfig:
    """Sizes and switches of one network; every field is a key of a preset's TOML.

    The five booleans at the end are the rows of the paper's ablation (its last table).
    """

    name: str
    input_height: int  # pixels; other aspect ratios keep the area
    input_width: int
    share_extractor: bool  # image and LiDAR depth run through the same trunk (the paper's arithmetic)
    share_image_branch: bool  # all stages use one image branch, computed once a frame
    widths: tuple[int, ...]  # channels at 1/2, 1/4, 1/8, 1/16, 1/32
    blocks: tuple[int, ...]  # residual blocks at each of these
    feature_channels: int  # channels of the features that are matched
    normalization: Literal["group", "batch"]
    scales: tuple[int, ...]  # strides of the cost volumes, fine to coarse, each twice the one before
    radius: int  # of the search window, in cells, the same at every scale
    groups: int  # of the group-wise correlation
    concat_channels: int  # of each branch in the concatenation volume
    volume_channels: int  # of the 3-D hourglass
    hourglass_blocks: int  # pairs of 3-D convolutions at each scale, on the way down and up
    hourglasses: int  # one after the other
    context_channels: int  # of the 2-D network that turns volumes into displacements
    head: Literal["geometric", "regression"]
    multi_scale_features: bool = True
    multi_scale_volumes: bool = True
    aggregation: bool = True
    hierarchical_fusion: bool = True
    hybrid_loss: bool = True

    def __post_init__(self) -> None:
        if len(self.widths) != len(self.blocks):
            raise ConfigError(f"Preset {self.name!r}: widths and blocks must have the same length.")
        if any(coarse != 2 * fine for fine, coarse in zip(self.scales, self.scales[1:], strict=False)):
            raise ConfigError(f"Preset {self.name!r}: each scale must be twice the one before.")
        if self.scales[-1] > 2 ** len(self.widths):
            raise ConfigError(f"Preset {self.name!r}: scale {self.scales[-1]} needs more widths.")
        if self.radius % 2:
            raise ConfigError(f"Preset {self.name!r}: the radius must be even, so that windows align across scales.")

    @property
    def volume_scales(self) -> tuple[int, ...]:
        """Strides at which volumes are built: only the finest without multi-scale volumes."""
        return self.scales if self.multi_scale_volumes else self.scales[:1]

    @property
    def window(self) -> int:
        """Side of the search window, in cells."""
        return 2 * self.radius + 1


def parse_config(values: dict[str, Any], origin: str) -> NetworkConfig:
    """Build a config from TOML values; ``ConfigError`` names unknown and missing keys."""
    names = {f.name for f in fields(NetworkConfig)}
    if unknown := sorted(set(values) - names):
        raise ConfigError(f"{origin} has unknown keys: {', '.join(unknown)}.")
    try:
        return NetworkConfig(**{key: tuple(v) if isinstance(v, list) else v for key, v in values.items()})
    except TypeError as error:
        raise ConfigError(f"{origin} is not a complete network: {error}.") from None


def preset_names() -> list[str]:
    """Names of the presets that ship with the package."""
    folder = resources.files("calibnet.network") / "presets"
    return sorted(entry.name.removesuffix(".toml") for entry in folder.iterdir() if entry.name.endswith(".toml"))


def load_preset(name: str) -> NetworkConfig:
    """Read a shipped preset; ``ConfigError`` lists the ones there are."""
    if name not in preset_names():
        raise ConfigError(f"There is no preset {name!r}; choose one of {', '.join(preset_names())}.")
    text = (resources.files("calibnet.network") / "presets" / f"{name}.toml").read_text(encoding="utf-8")
    return parse_config({"name": name, **tomllib.loads(text)}, f"Preset {name!r}")
