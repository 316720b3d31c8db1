"""The optimizer, the schedule of its learning rate, and the moving average of the weights."""

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
        network: the network to train.
        peak: the peak of the learning rate.
        recipe: the other settings.
        fused: whether a step is one operation for all weights; None lets PyTorch choose.
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
    """Set the rate for when ``share`` (0..1) of the budget is used: a linear rise, then a cosine decay."""
    rate = peak * min(1.0, (share + recipe.rate_start) / recipe.rate_ramp)
    cosine = 0.5 * (1 + math.cos(math.pi * share))
    for group in optimizer.param_groups:
        group["lr"] = group["relative"] * rate * (recipe.final_rate + (1 - recipe.final_rate) * cosine)


@torch.no_grad()
def update_average(average: AveragedModel, network: TrainedNetwork, steps: int, recipe: OptimizerRecipe) -> None:
    """Move an exponential moving average towards the network's weights.

    It averages over at most about the last tenth of the steps: in a run of some hundred steps it would otherwise be
    mostly of weights from before the network had learned anything. `AveragedModel`'s own update reads a counter on the
    device for this, which makes the host wait.

    Args:
        average: the moving average.
        network: the network after a step.
        steps: number of steps before this one; after the first step the average is a copy.
        recipe: how much of the average each step keeps.
    """
    kept = min(recipe.average_decay, (1 + steps) / (10 + steps)) if steps else 0.0
    means, ours = list[Tensor](average.module.parameters()), list[Tensor](network.parameters())
    torch._foreach_lerp_(means, ours, 1 - kept)
    for mean, buffer in zip(average.module.buffers(), network.buffers(), strict=True):
        mean.copy_(buffer)
