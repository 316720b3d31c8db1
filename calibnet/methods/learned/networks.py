"""Registry of the networks, by the names of their methods."""

from __future__ import annotations

from typing import TYPE_CHECKING

from calibnet.runtime.plugins import Registry

if TYPE_CHECKING:
    from calibnet.geometry import MiscalibrationRange
    from calibnet.methods.learned.config import MethodConfig
    from calibnet.methods.learned.network import MethodNetwork

FOLDER = "calibnet.methods.learned"

NETWORKS = Registry(
    "networks",
    "trained method",
    {
        "regnet": f"{FOLDER}.regnet:RegNet",
        "calibnet": f"{FOLDER}.calibnet2018:CalibNet2018",
        "lccnet": f"{FOLDER}.lccnet:LCCNet",
        "calibformer": f"{FOLDER}.calibformer:CalibFormer",
    },
)
"""Subclasses of `calibnet.methods.learned.network.MethodNetwork`; other packages register theirs as entry points."""


def method_network(config: MethodConfig, range_: MiscalibrationRange) -> MethodNetwork:
    """The network of a config, with random weights."""
    network: MethodNetwork = NETWORKS.load(config.name)(config, range_)
    return network
