"""From losses to weights: what is trained how fast, the learning rate over a run, the averaged weights."""

from __future__ import annotations

import math
from typing import TypeAlias

import torch
from torch import Tensor, nn
from torch.optim.swa_utils import AveragedModel, get_ema_multi_avg_fn

from calibnet.network.network import CalibrationNetwork
from calibnet.training.recipe import OptimizerRecipe
from calibnet.training.trained import TrainedNetwork

Tensors: TypeAlias = tuple[Tensor, ...] | list[Tensor]


def make_optimizer(network: TrainedNetwork, peak: float, recipe: OptimizerRecipe) -> torch.optim.AdamW:
    """AdamW for all that is not frozen; ``peak`` is the learning rate at its highest."""
    pretrained: set[nn.Parameter] = set()
    if isinstance(network, CalibrationNetwork):
        pretrained |= set(network.features.pretrained_levels().parameters())
    trained = [parameter for parameter in network.parameters() if parameter.requires_grad]
    groups = (
        {"params": [p for p in trained if p not in pretrained], "relative": 1.0},
        {"params": [p for p in trained if p in pretrained], "relative": recipe.pretrained_rate},
    )
    return torch.optim.AdamW([group for group in groups if group["params"]], lr=peak, weight_decay=recipe.weight_decay)


def set_learning_rate(optimizer: torch.optim.Optimizer, peak: float, share: float, recipe: OptimizerRecipe) -> None:
    """The rate when ``share`` (0..1) of the budget is used: up in a straight line, down along a cosine."""
    rate = peak * min(1.0, (share + recipe.rate_start) / recipe.rate_ramp)
    cosine = 0.5 * (1 + math.cos(math.pi * share))
    for group in optimizer.param_groups:
        group["lr"] = group["relative"] * rate * (recipe.final_rate + (1 - recipe.final_rate) * cosine)


def averaged(network: TrainedNetwork, recipe: OptimizerRecipe) -> AveragedModel:
    """A copy whose weights are the exponential moving average of the network's.

    The average is over the last tenth of the steps at most: in a run of some hundred steps it would otherwise be
    mostly of what the network was before it had learned anything.
    """

    @torch.no_grad()
    def average(averages: Tensors, current: Tensors, steps: Tensor | int) -> None:
        early = (1 + int(steps)) / (10 + int(steps))
        get_ema_multi_avg_fn(min(recipe.average_decay, early))(averages, current, steps)

    return AveragedModel(network, multi_avg_fn=average)
