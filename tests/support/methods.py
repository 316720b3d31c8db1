"""Networks of other papers with random weights, where what matters is what is done with them."""

from __future__ import annotations

from pathlib import Path

import torch

from calibnet.geometry import MiscalibrationRange
from calibnet.methods.learned.config import MethodConfig
from calibnet.methods.learned.networks import method_network
from calibnet.weights import save_network, weights_path

RECORD = {"samples": 640, "rigs": ["KITTI 2011_09_26"]}


def save_random(name: str, range_: MiscalibrationRange, folder: Path) -> Path:
    """Weights that no training made, where a method looks for them."""
    torch.manual_seed(0)
    network = method_network(MethodConfig(name), range_)
    path = weights_path(name, range_, folder)
    save_network(path, network, network.state_dict(), RECORD)
    return path
