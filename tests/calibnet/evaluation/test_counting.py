from __future__ import annotations

import itertools
import math
from dataclasses import replace
from math import prod

import pytest
import torch
from torch import nn

from calibnet.evaluation.counting import ModuleCost, count
from calibnet.geometry import RANGES
from calibnet.network.aggregation import Down
from calibnet.network.config import NetworkConfig, load_preset
from calibnet.network.convolution import Pointwise
from calibnet.network.cost_volume import RUN
from calibnet.network.network import CalibrationNetwork
from tests.support.tiny import random_inputs, tiny_network

HEIGHT, WIDTH = 64, 128


def convolutions(network: CalibrationNetwork) -> dict[str, int]:
    """Multiply-adds of the layers, from the shapes of their outputs; by the network's attribute.

    Without the hourglass's steps between scales and ends: they take volumes, with the channels last.
    """
    costs: dict[str, int] = {}

    def hook(name: str) -> object:
        def add(layer: nn.Module, inputs: tuple[torch.Tensor], output: torch.Tensor) -> None:
            weight = layer.weight
            assert isinstance(weight, torch.Tensor)
            places = prod(output.shape[2:]) * output.shape[0] if output.dim() > 2 else output.shape[0]
            costs[name] = costs.get(name, 0) + weight.numel() * places

        return add

    for name, layer in network.named_modules():
        if isinstance(layer, nn.Conv2d | nn.Conv3d | nn.Linear) and not isinstance(layer, Pointwise | Down):
            layer.register_forward_hook(hook(".".join(name.split(".")[: 2 if name.startswith("features") else 1])))
    with torch.no_grad():
        network(random_inputs(network.config, HEIGHT, WIDTH))
    return costs


def by_name(costs: list[ModuleCost]) -> dict[str, ModuleCost]:
    return {cost.name: cost for cost in costs}


def test_multiply_adds_are_those_of_layers_and_matrix_products() -> None:
    network = tiny_network(head="regression")
    costs = by_name(count(network, HEIGHT, WIDTH))
    config, layers = network.config, convolutions(network)
    assert costs["image features"].multiply_adds == layers["features.image_stem"] + layers["features.image_trunk"]
    assert costs["lidar features"].multiply_adds == layers["features.lidar_stem"] + layers["features.lidar_trunk"]
    sizes = [(HEIGHT // scale, WIDTH // scale) for scale in config.scales]
    compared = RUN * config.window * (RUN + 2 * config.radius)  # pairs of cells for each run of a row
    products = sum(h * math.ceil(w / RUN) * compared * config.feature_channels for h, w in sizes)
    assert costs["cost volumes"].multiply_adds == layers["cost_volumes"] + products
    soft_argmax = sum(h * w * config.window**2 * 2 for h, w in sizes)
    assert costs["displacement"].multiply_adds == layers["displacement"] + soft_argmax
    assert costs["pose"].multiply_adds == layers["pose"]
    refined = sum(
        config.window**4 * channels * h * w
        for channels, (h, w) in zip(config.channels_at_scales[:-1], sizes[1:], strict=True)
    )
    fusing = config.hourglasses * (refined + between_scales(config, sizes))
    # into the volumes, and the score of every displacement
    inputs = config.groups + 2 * config.concat_channels
    ends = sum(
        config.window**2 * h * w * channels * (inputs + 1)
        for channels, (h, w) in zip(config.channels_at_scales, sizes, strict=True)
    )
    assert costs["hourglass"].multiply_adds == layers["aggregation"] + fusing + ends


def between_scales(config: NetworkConfig, sizes: list[tuple[int, int]], down: int | None = None) -> int:
    """Multiply-adds of one hourglass's 1x3x3 convolutions down and 1x1x1 convolutions up, all at the coarse size.

    So many displacements go ``down``: those that the coarse window has too, and not all as in the paper.
    """
    down = (config.radius + 1) ** 2 if down is None else down
    return sum(
        h * w * fine * coarse * (9 * down + config.window**2)
        for (fine, coarse), (h, w) in zip(itertools.pairwise(config.channels_at_scales), sizes[1:], strict=True)
    )


@pytest.mark.parametrize("share", [True, False])
def test_parameters_are_counted_once(share: bool) -> None:
    network = tiny_network(share_extractor=share)
    costs = by_name(count(network, HEIGHT, WIDTH))
    assert sum(cost.parameters for cost in costs.values()) == sum(p.numel() for p in network.parameters())
    stem = sum(p.numel() for p in network.features.lidar_stem.parameters())
    assert (costs["lidar features"].parameters == stem) == share
    assert costs["lidar features"].multiply_adds > 0.9 * costs["image features"].multiply_adds


def test_paper_preset_has_the_size_of_the_paper() -> None:
    config = load_preset("paper")
    costs = count(CalibrationNetwork(config, RANGES[0]), 256, 512)
    assert sum(cost.parameters for cost in costs) == pytest.approx(20.5e6, rel=0.01)
    sizes = [(256 // scale, 512 // scale) for scale in config.scales]
    spared = config.hourglasses * (between_scales(config, sizes, config.window**2) - between_scales(config, sizes))
    assert sum(cost.multiply_adds for cost in costs) + spared == pytest.approx(78.3e9, rel=0.01)


@pytest.mark.parametrize(
    ("switch", "parameters"), [("aggregation", 19.4e6), ("hierarchical_fusion", 18.8e6), ("hybrid_loss", 20.5e6)]
)
def test_ablated_sizes_that_fit_the_paper_s_table(switch: str, parameters: float) -> None:
    network = CalibrationNetwork(replace(load_preset("paper"), **{switch: False}), RANGES[0])
    assert sum(p.numel() for p in network.parameters()) == pytest.approx(parameters, rel=0.02)


def test_without_multi_scale_features_the_encoder_is_whole_as_the_paper_s_parameters_say() -> None:
    """18.7 M in the paper; our pyramid is half as large as what it removes, and an encoder without 1/32 has 5 M."""
    network = CalibrationNetwork(replace(load_preset("paper"), multi_scale_features=False), RANGES[0])
    assert sum(p.numel() for p in network.parameters()) == pytest.approx(19.85e6, rel=0.001)
