"""The rows of the paper's ablation (its Table 3) by name: which switch of `NetworkConfig` each turns off."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from calibnet.errors import ConfigError
from calibnet.network.config import NetworkConfig

FULL = "full"

ABLATIONS: dict[str, str | None] = {
    "multi-scale-features": "multi_scale_features",
    "multi-scale-volumes": "multi_scale_volumes",
    "aggregation": "aggregation",
    "hierarchical-fusion": "hierarchical_fusion",
    "hybrid-loss": "hybrid_loss",
    FULL: None,
}
"""The ablations in the order of the paper's rows; the last is the network with all modules."""


def ablated(config: NetworkConfig, name: str) -> NetworkConfig:
    """The network of a row.

    Raises:
        ConfigError: there is no such row.
    """
    if name not in ABLATIONS:
        raise ConfigError(f"{name!r} is not a row of the ablation; choose from {', '.join(ABLATIONS)}.")
    switch = ABLATIONS[name]
    changes: dict[str, Any] = {switch: False} if switch else {}
    return replace(config, **changes)


def ablation_folder(folder: Path, name: str) -> Path:
    """Folder of the weights of a row, within ``folder`` of all rows; files have the same names in each."""
    return folder / (name if name == FULL else f"without-{name}")
