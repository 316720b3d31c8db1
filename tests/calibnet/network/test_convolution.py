from __future__ import annotations

import pytest
import torch
import torch.nn.functional as F
from torch import Tensor, nn

from calibnet.network.convolution import HAS_ONEDNN, SIZES, Conv2d, Conv3d, pack
from tests.support.tiny import random_inputs, tiny_network

pytestmark = pytest.mark.skipif(not HAS_ONEDNN, reason="this machine has no oneDNN for x86")


def images(*shape: int) -> Tensor:
    torch.manual_seed(0)
    layout = torch.channels_last if len(shape) == 4 else torch.channels_last_3d
    return (4 * torch.randn(*shape)).contiguous(memory_format=layout)


@pytest.mark.parametrize("activation", [None, "relu", "relu6"])
@pytest.mark.parametrize("precision", [torch.float32, torch.bfloat16])
@pytest.mark.parametrize(
    ("layer", "shape"),
    [
        (Conv2d, (2, 6, 9, 12)),
        (Conv3d, (2, 6, 5, 9, 12)),
    ],
)
@pytest.mark.parametrize("options", [{"padding": 1}, {"stride": 2, "groups": 2}, {"padding": 2, "dilation": 2}])
def test_packed_it_says_the_same(
    activation: str | None, precision: torch.dtype, layer: type[Conv2d], shape: tuple[int, ...], options: dict[str, int]
) -> None:
    convolution, x = layer(6, 8, 3, activation=activation, **options).eval(), images(*shape)
    plain = layer.__mro__[2](6, 8, 3, **options)
    plain.load_state_dict(convolution.state_dict())
    with torch.no_grad(), torch.autocast("cpu", torch.bfloat16, enabled=precision == torch.bfloat16):
        expected = plain(x)
        if activation:
            expected = expected.clamp(0, 6 if activation == "relu6" else None)
        torch.testing.assert_close(convolution(x), expected)
        pack(convolution, precision)
        assert convolution.packed is not None
        found = convolution(x)
    assert found.dtype == precision
    torch.testing.assert_close(found, expected)


def test_a_network_packs_all_its_layers_and_says_the_same() -> None:
    network = tiny_network()
    inputs = random_inputs(network.config)
    with torch.no_grad():
        before = network(inputs)
        pack(network, torch.float32)
        assert all(layer.packed for layer in network.modules() if isinstance(layer, Conv2d | Conv3d))
        after = network(inputs)
    torch.testing.assert_close(after.logits, before.logits, rtol=1e-3, atol=1e-4)
    torch.testing.assert_close(after.field.displacement, before.field.displacement, rtol=1e-3, atol=1e-4)


@pytest.mark.parametrize("precision", [torch.float32, torch.bfloat16])
def test_packed_it_says_the_same_of_every_size(precision: torch.dtype) -> None:
    convolution = Conv2d(80, 96, 1).eval()
    sizes = [images(1, 80, height, 22) for height in range(1, SIZES + 3)]
    pack(convolution, precision)
    for x in [*sizes, *sizes]:  # more than are kept, and some again
        with torch.no_grad():
            expected = F.conv2d(x.to(precision), convolution.weight.to(precision), convolution.bias.to(precision))
            torch.testing.assert_close(convolution(x), expected)


def test_what_is_trained_again_is_not_packed() -> None:
    convolution, x = Conv2d(3, 4, 3).eval(), images(1, 3, 8, 8)
    pack(convolution, torch.float32)
    convolution.train()
    nn.init.zeros_(convolution.weight)
    assert convolution.bias is not None
    nn.init.zeros_(convolution.bias)
    y = convolution(x)
    assert not y.any() and y.requires_grad
