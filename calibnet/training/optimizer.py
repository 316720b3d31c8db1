"""From losses to weights: what is trained how fast, the learning rate over a run, the averaged weights."""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn
from torch.optim.swa_utils import AveragedModel

from calibnet.network.network import CalibrationNetwork
from calibnet.training.recipe import OptimizerRecipe
from calibnet.training.trained import TrainedNetwork


def make_optimizer(
    network: TrainedNetwork, peak: float, recipe: OptimizerRecipe, fused: bool | None = None
) -> torch.optim.AdamW:
    """AdamW for all that is not frozen.

    Args:
        network: to be trained.
        peak: the learning rate at its highest.
        recipe: the rest.
        fused: a step is one operation for all weights, where the device they will be on has it.
    """
    pretrained: set[nn.Parameter] = set()
    if isinstance(network, CalibrationNetwork):
        pretrained |= set(network.features.pretrained_levels().parameters())
    trained = [parameter for parameter in network.parameters() if parameter.requires_grad]
    groups = (
        {"params": [p for p in trained if p not in pretrained], "relative": 1.0},
        {"params": [p for p in trained if p in pretrained], "relative": recipe.pretrained_rate},
    )
    given = [group for group in groups if group["params"]]
    return torch.optim.AdamW(given, lr=peak, weight_decay=recipe.weight_decay, fused=fused)


def set_learning_rate(optimizer: torch.optim.Optimizer, peak: float, share: float, recipe: OptimizerRecipe) -> None:
    """The rate when ``share`` (0..1) of the budget is used: up in a straight line, down along a cosine."""
    rate = peak * min(1.0, (share + recipe.rate_start) / recipe.rate_ramp)
    cosine = 0.5 * (1 + math.cos(math.pi * share))
    for group in optimizer.param_groups:
        group["lr"] = group["relative"] * rate * (recipe.final_rate + (1 - recipe.final_rate) * cosine)


@torch.no_grad()
def update_average(average: AveragedModel, network: TrainedNetwork, steps: int, recipe: OptimizerRecipe) -> None:
    """Move an exponential moving average towards the network's weights.

    The average is over the last tenth of the steps at most: in a run of some hundred steps it would otherwise be
    mostly of what the network was before it had learned anything. `AveragedModel` itself reads a counter on the device
    for this, and waits for it.

    Args:
        average: of the network.
        network: whose weights a step has just changed.
        steps: before this one; after the first step the average is a copy.
        recipe: how much of the average a step keeps.
    """
    kept = min(recipe.average_decay, (1 + steps) / (10 + steps)) if steps else 0.0
    means, ours = list[Tensor](average.module.parameters()), list[Tensor](network.parameters())
    torch._foreach_lerp_(means, ours, 1 - kept)
    for mean, buffer in zip(average.module.buffers(), network.buffers(), strict=True):
        mean.copy_(buffer)
