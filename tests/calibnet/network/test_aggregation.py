from __future__ import annotations

from dataclasses import replace

import pytest
import torch
import torch.nn.functional as F
from torch import Tensor, nn

from calibnet.network.aggregation import Aggregation, Down, Hourglass, WindowConv
from calibnet.network.convolution import HAS_ONEDNN, Pointwise, pack
from calibnet.network.cost_volume import LOGIT_SCALE, Volume
from calibnet.network.fusion import Fusion, refine_window, upsample_nearest
from tests.support.tiny import TINY


def linear_window(radius: int, slope_y: float, slope_x: float) -> Tensor:
    """``[1, Dy, Dx, 1, 1, 1]``: a linear function of the displacement in cells."""
    axis = torch.arange(-radius, radius + 1, dtype=torch.float64)
    return (slope_y * axis[:, None] + slope_x * axis)[None, :, :, None, None, None]


def passing(down: Down) -> Down:
    """The same layer with weights that hand every other cell on, channel by channel."""
    nn.init.dirac_(down.weight)
    assert down.bias is not None
    nn.init.zeros_(down.bias)
    return down


def noise(*shape: int) -> Tensor:
    return torch.randn(*shape, dtype=torch.float64, generator=torch.Generator().manual_seed(0))


@pytest.mark.parametrize("radius", [2, 4, 6])
def test_coarsening_keeps_displacements_in_pixels(radius: int) -> None:
    coarse = passing(Down(1, 1).double())(linear_window(radius, 3.0, -5.0)).squeeze()
    for dy in range(-radius, radius + 1):
        for dx in range(-radius, radius + 1):
            covered = 2 * abs(dy) <= radius and 2 * abs(dx) <= radius
            expected = 3.0 * 2 * dy - 5.0 * 2 * dx if covered else 0.0  # a coarse cell is two fine ones
            assert coarse[dy + radius, dx + radius] == expected


@pytest.mark.parametrize("radius", [2, 4, 6])
def test_refining_keeps_displacements_in_pixels(radius: int) -> None:
    fine = refine_window(linear_window(radius, 3.0, -5.0))
    torch.testing.assert_close(fine, linear_window(radius, 1.5, -2.5))


@pytest.mark.parametrize("radius", [2, 4])
def test_refining_is_bilinear_interpolation_of_the_centre(radius: int) -> None:
    volume = noise(2, 2 * radius + 1, 2 * radius + 1, 2, 3, 4)
    fine = refine_window(volume)
    for dy in range(-radius, radius + 1):
        for dx in range(-radius, radius + 1):
            expected = torch.zeros_like(fine[:, 0, 0])
            for y, x in {
                (dy // 2, dx // 2),
                (-(-dy // 2), dx // 2),
                (dy // 2, -(-dx // 2)),
                (-(-dy // 2), -(-dx // 2)),
            }:
                share = (1 - abs(dy / 2 - y)) * (1 - abs(dx / 2 - x))
                expected += share * volume[:, y + radius, x + radius]
            torch.testing.assert_close(fine[:, dy + radius, dx + radius], expected)


def test_windows_change_neither_cells_nor_channels() -> None:
    volume = torch.zeros(2, 5, 5, 4, 6, 3)
    volume[1, 2, 2, 2, 4, 2] = 1.0  # no displacement, one cell
    refined, coarse = refine_window(volume), passing(Down(3, 3))(volume)
    assert refined[1, 2, 2, 2, 4, 2] == refined.amax((1, 2)).sum() == 1.0
    assert coarse[1, 2, 2, 1, 2, 2] == coarse.sum() == 1.0


def test_doubling_repeats_cells_and_nothing_else() -> None:
    volume = noise(2, 3, 3, 2, 3, 4)
    doubled = upsample_nearest(volume)
    assert doubled.shape == (2, 3, 3, 4, 6, 4)
    for y in range(4):
        for x in range(6):
            assert torch.equal(doubled[:, :, :, y, x], volume[:, :, :, y // 2, x // 2])


@pytest.mark.parametrize("axis", ["x", "y"])
def test_window_convolution_leaves_the_rows_of_the_window_apart(axis: str) -> None:
    layer, volume = WindowConv(3, axis).double(), noise(2, 5, 5, 4, 6, 3)
    along = 1 if axis == "x" else 2  # the axis that is not convolved
    rows = [part.movedim(-1, 1) for part in volume.unbind(along)]  # [B, C, D, h, w]
    convolved = [F.conv3d(row, layer.conv.weight, layer.conv.bias, padding=1).movedim(1, -1) for row in rows]
    torch.testing.assert_close(layer(volume), torch.stack(convolved, dim=along))


def test_going_down_is_a_convolution_of_every_image_of_shared_displacements() -> None:
    layer, volume = Down(3, 4).double(), noise(2, 5, 5, 4, 6, 3)
    coarse = layer(volume)
    assert coarse.shape == (2, 5, 5, 2, 3, 4)
    for dy in range(-2, 3):
        for dx in range(-2, 3):
            expected = torch.zeros(2, 2, 3, 4, dtype=torch.float64)
            if abs(dy) < 2 and abs(dx) < 2:
                image = volume[:, 2 + 2 * dy, 2 + 2 * dx].permute(0, 3, 1, 2)
                expected = F.conv2d(image, layer.weight[:, :, 0], layer.bias, 2, 1).permute(0, 2, 3, 1)
            torch.testing.assert_close(coarse[:, dy + 2, dx + 2], expected)


def test_a_fused_volume_is_read_as_if_it_were_made() -> None:
    fusion, head = Fusion(noise(2, 5, 5, 4, 6, 3), noise(2, 5, 5, 2, 3, 3)), Pointwise(3, 2).double()
    assert fusion.coarser is not None
    volume = fusion.own + refine_window(upsample_nearest(fusion.coarser))
    torch.testing.assert_close(fusion.volume(), volume)
    for found, made in ((fusion.read(head), volume), (Fusion(fusion.own).read(head), fusion.own)):
        expected = torch.einsum("...c,kc->...k", made, head.weight.flatten(1)) + head.bias
        torch.testing.assert_close(found, expected)


@pytest.mark.skipif(not HAS_ONEDNN, reason="this machine has no oneDNN for x86")
@pytest.mark.parametrize("activation", [None, "relu"])
@pytest.mark.parametrize("size", [(4, 6), (1, 6), (3, 1)])  # four, two and one cell at once
def test_pointwise_convolution_says_the_same_packed(activation: str | None, size: tuple[int, int]) -> None:
    layer, volume = Pointwise(3, 4, activation).eval(), noise(1, 5, 5, *size, 3).float()
    with torch.no_grad():
        plain = layer(volume)
        expected = torch.einsum("...c,kc->...k", volume, layer.weight.flatten(1)) + layer.bias
        torch.testing.assert_close(plain, expected.relu() if activation else expected)
        pack(layer, torch.float32)
        assert layer.packed is not None
        torch.testing.assert_close(layer(volume), plain)


def volumes_of(channels: tuple[int, ...], window: int) -> list[Tensor]:
    torch.manual_seed(0)
    return [
        torch.randn(1, window, window, 8 >> scale, 12 >> scale, width, requires_grad=True)
        for scale, width in enumerate(channels)
    ]


@pytest.mark.parametrize("scales", [(8,), (8, 16), (8, 16, 32)])
@pytest.mark.parametrize("fuse", [True, False])
def test_hourglass_fuses_scales_only_when_asked(scales: tuple[int, ...], fuse: bool) -> None:
    channels = (4, 6, 8)[: len(scales)]
    config = replace(TINY, scales=scales, volume_channels=channels, hierarchical_fusion=fuse)
    volumes = volumes_of(channels, config.window)
    left = [fusion.volume() for fusion in Hourglass(config, blocks=1)(volumes)]
    assert [volume.shape for volume in left] == [volume.shape for volume in volumes]
    for scale, output in enumerate(left):
        gradients = torch.autograd.grad(output.sum(), volumes, retain_graph=True, allow_unused=True)
        reached = [gradient is not None and bool(gradient.abs().sum() > 0) for gradient in gradients]
        assert reached == [fuse or scale == other for other in range(len(scales))]


@pytest.mark.parametrize("convolve_finest", [True, False])
def test_hourglass_is_that_of_the_figure(convolve_finest: bool) -> None:
    """Down with a sum at every scale, up with another, and a block after each but at the finest scale."""
    config = replace(TINY, scales=(8, 16), volume_channels=(4, 6), convolve_finest=convolve_finest)
    hourglass, (fine, coarse) = Hourglass(config, blocks=1), volumes_of((4, 6), config.window)
    coarse = hourglass.up_blocks[1](hourglass.down_blocks[1](coarse + hourglass.down[0](fine)))
    fine = fine + upsample_nearest(refine_window(hourglass.up[0](coarse)))
    if convolve_finest:
        block = hourglass.up_blocks[0][0]
        fine = (fine + block.y(block.x(fine))).relu()
    for found, expected in zip(hourglass(volumes_of((4, 6), config.window)), (fine, coarse), strict=True):
        torch.testing.assert_close(found.volume(), expected)


@pytest.mark.parametrize("convolve_finest", [True, False])
@pytest.mark.parametrize("fuse", [True, False])
def test_aggregation_scores_every_displacement_of_every_scale(convolve_finest: bool, fuse: bool) -> None:
    inputs = TINY.groups + 2 * TINY.concat_channels
    raw = [torch.randn(1, 25, 8 >> scale, 12 >> scale) for scale in range(3)]
    aggregation = Aggregation(replace(TINY, convolve_finest=convolve_finest, hierarchical_fusion=fuse))
    volumes = [Volume(*both) for both in zip(volumes_of((inputs,) * 3, TINY.window), raw, strict=True)]
    logits, activations = aggregation(volumes, keep_activations=True)
    assert activations is not None
    shapes = [(1, 4, 25, 8, 12), (1, 6, 25, 4, 6), (1, 8, 25, 2, 3)]
    assert [tuple(volume.shape) for volume in activations.before] == shapes
    assert [tuple(volume.shape) for volume in activations.after] == shapes
    assert [tuple(scores.shape) for scores in logits] == [(1, 25, 8, 12), (1, 25, 4, 6), (1, 25, 2, 3)]
    for scale, (scores, scale_logits) in enumerate(zip(raw, logits, strict=True)):
        head = aggregation.score[scale]
        added = F.conv3d(activations.after[scale], head.weight, head.bias)[:, 0]
        torch.testing.assert_close(scale_logits, LOGIT_SCALE * scores + added)
    same, nothing = aggregation(volumes)
    assert nothing is None
    torch.testing.assert_close(same, logits)


def test_one_number_stands_for_all_scales_and_hourglasses() -> None:
    config = replace(TINY, volume_channels=8, hourglass_blocks=2, hourglasses=3)
    assert config.channels_at_scales == (8, 8, 8)
    assert config.blocks_of_hourglasses == (2, 2, 2)
    assert replace(config, aggregation=False).blocks_of_hourglasses == (2, 2)
    assert replace(config, multi_scale_volumes=False).channels_at_scales == (8,)
