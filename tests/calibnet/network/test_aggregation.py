from __future__ import annotations

from dataclasses import replace

import pytest
import torch
import torch.nn.functional as F
from torch import Tensor

from calibnet.network.aggregation import (
    Aggregation,
    Hourglass,
    WindowConv,
    centre_in_window,
    every_second,
    pointwise_each,
    refine_window,
)
from calibnet.network.cost_volume import TEMPERATURE
from tests.support.tiny import TINY


def linear_window(radius: int, slope_y: float, slope_x: float) -> Tensor:
    """``[1, 1, D, 1, 1]``: a linear function of the displacement in cells, row by row."""
    values = [slope_y * dy + slope_x * dx for dy in range(-radius, radius + 1) for dx in range(-radius, radius + 1)]
    return torch.tensor(values, dtype=torch.float64).reshape(1, 1, -1, 1, 1)


@pytest.mark.parametrize("radius", [2, 4, 6])
def test_coarsening_keeps_displacements_in_pixels(radius: int) -> None:
    window = 2 * radius + 1
    picked = every_second(linear_window(radius, 3.0, -5.0), window)
    coarse = centre_in_window(picked, window).reshape(window, window)
    for dy in range(-radius, radius + 1):
        for dx in range(-radius, radius + 1):
            covered = 2 * abs(dy) <= radius and 2 * abs(dx) <= radius
            expected = 3.0 * 2 * dy - 5.0 * 2 * dx if covered else 0.0  # a coarse cell is two fine ones
            assert coarse[dy + radius, dx + radius] == expected


@pytest.mark.parametrize("radius", [2, 4, 6])
def test_refining_keeps_displacements_in_pixels(radius: int) -> None:
    fine = refine_window(linear_window(radius, 3.0, -5.0), 2 * radius + 1)
    torch.testing.assert_close(fine, linear_window(radius, 1.5, -2.5))


def test_windows_change_neither_cells_nor_channels() -> None:
    volume = torch.zeros(2, 3, 25, 4, 5)
    volume[1, 2, 12, 3, 1] = 1.0  # no displacement, one cell
    for moved in (centre_in_window(every_second(volume, 5), 5), refine_window(volume, 5)):
        assert moved[1, 2, 12, 3, 1] == 1.0
        assert moved.amax(2).sum() == 1.0


@pytest.mark.parametrize("axis", ["x", "y"])
def test_window_convolution_leaves_the_rows_of_the_window_apart(axis: str) -> None:
    torch.manual_seed(0)
    layer = WindowConv(3, 5, axis).double()
    volume = torch.randn(2, 3, 25, 4, 6, dtype=torch.float64)
    window = volume.unflatten(2, (5, 5))  # [B, C, Dy, Dx, h, w]
    along = 2 if axis == "x" else 3  # the axis that is not convolved
    expected = torch.stack(
        [F.conv3d(part, layer.conv.weight, layer.conv.bias, padding=1) for part in window.unbind(along)], dim=along
    )
    torch.testing.assert_close(layer(volume), expected.flatten(2, 3))


def volumes_of(channels: tuple[int, ...], window: int) -> list[Tensor]:
    torch.manual_seed(0)
    return [
        torch.randn(1, width, window**2, 8 >> scale, 12 >> scale, requires_grad=True)
        for scale, width in enumerate(channels)
    ]


@pytest.mark.parametrize("scales", [(8,), (8, 16), (8, 16, 32)])
@pytest.mark.parametrize("fuse", [True, False])
def test_hourglass_fuses_scales_only_when_asked(scales: tuple[int, ...], fuse: bool) -> None:
    channels = (4, 6, 8)[: len(scales)]
    config = replace(TINY, scales=scales, volume_channels=channels, hierarchical_fusion=fuse)
    volumes = volumes_of(channels, config.window)
    left = Hourglass(config, blocks=1)(volumes)
    assert [volume.shape for volume in left] == [volume.shape for volume in volumes]
    for scale, output in enumerate(left):
        gradients = torch.autograd.grad(output.sum(), volumes, retain_graph=True, allow_unused=True)
        reached = [gradient is not None and bool(gradient.abs().sum() > 0) for gradient in gradients]
        assert reached == [fuse or scale == other for other in range(len(scales))]


@pytest.mark.parametrize("scales", [(8,), (8, 16), (8, 16, 32)])
@pytest.mark.parametrize("fuse", [True, False])
@pytest.mark.parametrize("convolve_finest", [True, False])
def test_volumes_are_read_as_if_they_were_made(scales: tuple[int, ...], fuse: bool, convolve_finest: bool) -> None:
    channels = (4, 6, 8)[: len(scales)]
    config = replace(
        TINY, scales=scales, volume_channels=channels, hierarchical_fusion=fuse, convolve_finest=convolve_finest
    )
    hourglass, volumes = Hourglass(config, blocks=1), volumes_of(channels, config.window)
    heads = torch.nn.ModuleList(torch.nn.Conv3d(width, 2, 1) for width in channels)
    found, expected = hourglass.read(hourglass.descend(volumes), heads), pointwise_each(heads, hourglass(volumes))
    for volume, other in zip(found, expected, strict=True):
        torch.testing.assert_close(volume, other)


def test_aggregation_scores_every_displacement_of_every_scale() -> None:
    inputs = TINY.groups + 2 * TINY.concat_channels
    raw = [torch.randn(1, 25, 8 >> scale, 12 >> scale) for scale in range(3)]
    aggregation = Aggregation(TINY)
    before, after, logits = aggregation(volumes_of((inputs,) * 3, TINY.window), raw, keep_activations=True)
    assert [tuple(volume.shape[:3]) for volume in before] == [(1, 4, 25), (1, 6, 25), (1, 8, 25)]
    assert [volume.shape for volume in after] == [volume.shape for volume in before]
    assert [tuple(scores.shape) for scores in logits] == [(1, 25, 8, 12), (1, 25, 4, 6), (1, 25, 2, 3)]
    for scale, (scores, scale_logits) in enumerate(zip(raw, logits, strict=True)):
        added = aggregation.score[scale](after[scale])[:, 0]
        torch.testing.assert_close(scale_logits, TEMPERATURE * scores + added)
    nothing, same = aggregation(volumes_of((inputs,) * 3, TINY.window), raw)[1:]
    assert nothing == []
    torch.testing.assert_close(same, logits)


def test_one_number_stands_for_all_scales_and_hourglasses() -> None:
    config = replace(TINY, volume_channels=8, hourglass_blocks=2, hourglasses=3)
    assert config.channels_at_scales == (8, 8, 8)
    assert config.blocks_of_hourglasses == (2, 2, 2)
    assert replace(config, aggregation=False).blocks_of_hourglasses == (2, 2)
    assert replace(config, multi_scale_volumes=False).channels_at_scales == (8,)
