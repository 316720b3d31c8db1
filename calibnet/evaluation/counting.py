"""Counts parameters and multiply-adds of a network, per box of the paper's figure."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import nn
from torch.utils.flop_counter import FlopCounterMode

from calibnet.network.batch import NetworkInputs
from calibnet.network.network import CalibrationNetwork
from calibnet.runtime.clock import after_each

HEIGHT, WIDTH = 256, 512
"""Input size at which multiply-adds are counted, as in the paper."""


class ModuleCost(NamedTuple):
    """The cost of one box of the figure.

    Attributes:
        name: ``"image features"`` to ``"pose"``.
        parameters: number of its parameters; those that two boxes share count in the first.
        multiply_adds: multiply-adds of its convolutions and matrix products, for one sample.
    """

    name: str
    parameters: int
    multiply_adds: int


def count(network: CalibrationNetwork, height: int = HEIGHT, width: int = WIDTH) -> list[ModuleCost]:
    """Count a forward pass of one image and scan of ``height`` x ``width`` pixels, by running it.

    As usual in this field, normalisation, activations, interpolation and the pose solver's 6x6 systems are not
    counted.
    """
    features, boxes = network.features, network.boxes
    modules: dict[str, list[nn.Module]] = {
        "image_features": [features.image_stem, features.image_trunk],
        **{part: [box] for part, box in boxes.items()},
        "lidar_features": [features.lidar_stem, features.lidar_trunk],
    }
    flops = dict.fromkeys(modules, 0)
    inputs = empty_inputs(network, height, width)
    with torch.no_grad(), FlopCounterMode(display=False) as counter:

        def done(part: str) -> None:
            flops[part] += counter.get_total_flops() - sum(flops.values())

        image_features = features.image(inputs.image)
        done("image_features")
        with after_each(boxes, done):
            network(inputs, image_features)
    parameters = own_parameters(modules)
    return [ModuleCost(part.replace("_", " "), parameters[part], flops[part] // 2) for part in modules]


def total(network: CalibrationNetwork) -> tuple[int, int]:
    """Parameters and multiply-adds of the whole network, at the paper's input size."""
    costs = count(network)
    return sum(cost.parameters for cost in costs), sum(cost.multiply_adds for cost in costs)


def own_parameters(modules: dict[str, list[nn.Module]]) -> dict[str, int]:
    """Numbers of parameters by part, each parameter counted in the first part that has it."""
    counted: set[nn.Parameter] = set()
    numbers = {}
    for part, members in modules.items():
        own = {parameter for module in members for parameter in module.parameters()} - counted
        numbers[part] = sum(parameter.numel() for parameter in own)
        counted |= own
    return numbers


def empty_inputs(network: CalibrationNetwork, height: int, width: int) -> NetworkInputs:
    """Inputs of one sample without LiDAR points, on which the cost does not depend."""
    device = next(network.parameters()).device
    return NetworkInputs(
        image=torch.zeros(1, 3, height, width, device=device),
        lidar=torch.zeros(1, 2, height, width, device=device),
        intrinsics=torch.eye(3, device=device)[None],
        cells=[torch.zeros(1, 3, height // s, width // s, device=device) for s in network.config.scales],
    )
