"""Counts the multiply-adds of a network of another paper, by running it on the meta device."""

from __future__ import annotations

import torch
from torch.utils.flop_counter import FlopCounterMode

from calibnet.methods.learned.network import MethodNetwork
from calibnet.methods.learned.networks import method_network
from calibnet.network.batch import NetworkInputs


def multiply_adds(network: MethodNetwork) -> int:
    """Multiply-adds of a network's convolutions and matrix products, for one look at one frame.

    A copy is run in training mode, as PyTorch does not count the fused attention of inference.
    """
    config = network.config
    height, width = config.input_height, config.input_width
    with torch.device("meta"), torch.no_grad(), FlopCounterMode(display=False) as counter:
        like = method_network(config, network.range).train()
        inputs = NetworkInputs(
            image=torch.zeros(1, 3, height, width),
            lidar=torch.zeros(1, 2, height, width),
            intrinsics=torch.zeros(1, 3, 3),
            cells=[torch.zeros(1, 3, height // s, width // s) for s in config.scales],
        )
        like(inputs)
    return int(counter.get_total_flops()) // 2
