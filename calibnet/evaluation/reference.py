"""Times a stage of another paper's cascade on the same machine, to compare our times with.

Milliseconds depend on the machine, and on what else runs there, as much as on a network. LCCNet's five networks
(`calibnet.methods.learned.lccnet`: two ResNet-18, 58 M parameters, 9.4 G multiply-adds) are the usual cascade of this
field. One such network with random weights is timed in turn with ours, in its fastest form.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable

import torch
from torch import nn
from torch.nn.utils.fusion import fuse_conv_bn_eval

from calibnet.geometry import RANGES
from calibnet.methods.learned.config import MethodConfig
from calibnet.methods.learned.networks import method_network
from calibnet.network.convolution import Conv2d, pack
from calibnet.network.layers import channels_last
from calibnet.runtime.precision import fastest

NAME = "lccnet"
STAGES = 5
"""Number of networks of its cascade."""
RUNS = 3
"""Number of runs by which the precision is chosen."""


def reference_run(device: torch.device) -> Callable[[], float]:
    """A function that runs one such network on one frame and returns the milliseconds."""
    runs = [_timed(device, precision) for precision in {torch.float32, fastest(device)}]
    return min(runs, key=lambda run: min(run() for _ in range(RUNS)))


def _timed(device: torch.device, precision: torch.dtype) -> Callable[[], float]:
    config = MethodConfig(NAME)
    network = method_network(config, RANGES[0]).eval()
    fold(network)
    channels_last(network)
    network.to(device, precision)
    pack(network, precision)
    size = (config.input_height, config.input_width)
    image, depth = (
        torch.rand(1, channels, *size).to(device, precision).contiguous(memory_format=torch.channels_last)
        for channels in (3, 1)
    )

    @torch.inference_mode()
    def run() -> float:
        started = time.perf_counter()
        network.estimate(image, depth).correction.cpu()  # waits for a GPU
        return 1000 * (time.perf_counter() - started)

    return run


def fold(network: nn.Module) -> None:
    """Fold every batch norm into the convolution before it, and make convolutions packable, in place."""
    for sequence in [module for module in network.modules() if isinstance(module, nn.Sequential)]:
        for position, (layer, norm) in enumerate(itertools.pairwise([*sequence, None])):
            if not isinstance(layer, nn.Conv2d):
                continue
            normed = isinstance(norm, nn.BatchNorm2d)
            plain = fuse_conv_bn_eval(layer, norm) if normed else layer
            sequence[position] = packable(plain)
            if normed:
                sequence[position + 1] = nn.Identity()


def packable(layer: nn.Conv2d) -> Conv2d:
    """The same convolution as one of `calibnet.network.convolution`, which can be packed."""
    sizes = (layer.in_channels, layer.out_channels, layer.kernel_size, layer.stride, layer.padding)
    same = Conv2d(*sizes, bias=layer.bias is not None)
    same.load_state_dict(layer.state_dict())
    return same.eval()
