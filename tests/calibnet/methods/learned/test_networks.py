"""The networks of other papers: their sizes, what goes in and out of them, and that they can learn."""

from __future__ import annotations

import math

import pytest
import torch
from torch import Tensor
from torch.utils.flop_counter import FlopCounterMode

from calibnet.geometry import RANGES, miscalibration
from calibnet.methods.learned.config import MethodConfig
from calibnet.methods.learned.network import MethodNetwork, fitted_depth, fitted_image
from calibnet.methods.learned.networks import NETWORKS, method_network
from calibnet.network.batch import NetworkInputs
from calibnet.network.target import Target
from calibnet.training.recipe import RECIPE
from calibnet.training.samples import collate, make_sample
from tests.support.scene import make_frame

NAMES = tuple(NETWORKS.own)
RANGE = RANGES[2]


def network_of(name: str) -> MethodNetwork:
    torch.manual_seed(0)
    return method_network(MethodConfig(name), RANGE)


def batch(*turns: float) -> tuple[NetworkInputs, Target]:
    """Scenes, each turned by so many degrees of yaw."""
    deltas = [miscalibration([0.0, 0.0, turn], [0.05 * turn, 0.0, 0.0]) for turn in turns]
    frames = [make_frame(seed, 256, 96) for seed in range(len(turns))]
    scales = MethodConfig.scales
    return collate([make_sample(f, delta, scales, RECIPE.sample) for f, delta in zip(frames, deltas, strict=True)])


SIZES = {
    "regnet": (16.13e6, 4.29e9),
    "calibnet": (24.33e6, 6.16e9),
    "lccnet": (58.30e6, 9.45e9),
    "calibformer": (27.98e6, 11.14e9),
}
"""Parameters, and multiply-adds of one frame; LCCNet's are those of the published network's forward pass."""


@pytest.mark.parametrize("name", NAMES)
def test_sizes(name: str) -> None:
    network, (inputs, _) = network_of(name), batch(1.0, 1.0)
    with torch.no_grad(), FlopCounterMode(display=False) as counter:
        network(inputs)
    parameters, multiply_adds = SIZES[name]
    assert sum(parameter.numel() for parameter in network.parameters()) == pytest.approx(parameters, rel=1e-3)
    assert counter.get_total_flops() / 2 / 2 == pytest.approx(multiply_adds, rel=1e-3)


@pytest.mark.parametrize("name", NAMES)
def test_untrained_it_moves_next_to_nothing_and_hears_image_and_scan(name: str) -> None:
    network, (inputs, _) = network_of(name).eval(), batch(2.0)
    with torch.no_grad():
        output = network(inputs)
        other_picture = network(inputs._replace(image=255 - inputs.image)).correction
        other_scan = network(inputs._replace(lidar=1.5 * inputs.lidar)).correction
    correction = output.correction
    assert correction.shape == (1, 4, 4) and correction.dtype == torch.float32
    assert (correction - torch.eye(4)).abs().max() < 0.1 * RANGE.translation_m
    torch.testing.assert_close(correction[0, :3, :3] @ correction[0, :3, :3].T, torch.eye(3))
    assert not torch.equal(correction, other_picture) and not torch.equal(correction, other_scan)
    assert output.shown and all(shown.ndim == 3 and len(shown) == 1 for shown in output.shown.values())


@pytest.mark.parametrize("name", NAMES)
def test_some_steps_lower_the_loss_of_one_batch_and_reach_every_parameter(name: str) -> None:
    network, (inputs, target) = network_of(name).train(), batch(3.0, -3.0)
    for layer in network.modules():
        if isinstance(layer, torch.nn.Dropout):
            layer.p = 0.0
    optimizer = torch.optim.AdamW(network.parameters(), lr=1e-4)
    totals = []
    for _ in range(4):
        losses = network.losses(network(inputs), inputs, target)
        totals.append(float(losses.total.detach()))
        optimizer.zero_grad()
        losses.total.backward()
        for parameter, tensor in network.named_parameters():
            assert tensor.grad is not None and tensor.grad.isfinite().all(), parameter
        optimizer.step()
    assert math.isfinite(totals[-1]) and min(totals[1:]) < 0.9 * totals[0], totals


def inputs_of(image: Tensor, depth: Tensor) -> NetworkInputs:
    lidar = torch.stack([depth, torch.zeros_like(depth)], dim=1)
    return NetworkInputs(image, lidar, torch.eye(3)[None], [])


def test_depth_maps_are_fitted_with_the_nearest_point_and_the_rows_that_were_cut() -> None:
    depth = torch.zeros(1, 4, 8)  # the lower half of an image of 8 x 8
    depth[0, 0, 0], depth[0, 0, 1], depth[0, 3, 7] = 8.0, 4.0, 0.5
    fitted = fitted_depth(inputs_of(torch.zeros(1, 3, 8, 8), depth), 16, 4)[0, 0]
    expected = torch.zeros(16, 4)
    expected[9, 0] = 1.0  # the nearer of two: 4 / 4 m
    expected[15, 3] = 4.0  # nearer than a metre counts as a metre
    torch.testing.assert_close(fitted, expected)


def test_images_are_fitted_and_normalised() -> None:
    image = torch.full((1, 3, 8, 8), 175, dtype=torch.uint8)
    fitted = fitted_image(inputs_of(image, torch.zeros(1, 8, 8)), 16, 4)
    torch.testing.assert_close(fitted, torch.ones(1, 3, 16, 4))
