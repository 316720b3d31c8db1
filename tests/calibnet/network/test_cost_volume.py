from __future__ import annotations

import pytest
import torch
from torch import Tensor

from calibnet.network.cost_volume import CostVolume, concatenation_volume, correlate
from calibnet.network.displacement import window_offsets
from tests.support.tiny import TINY


def shifted(image: Tensor, dy: int, dx: int) -> Tensor:
    """``image[..., y + dy, x + dx]`` with zeros outside, cell by cell."""
    height, width = image.shape[-2:]
    rows = []
    for y in range(height):
        row = []
        for x in range(width):
            inside = 0 <= y + dy < height and 0 <= x + dx < width
            row.append(image[..., y + dy, x + dx] if inside else torch.zeros_like(image[..., 0, 0]))
        rows.append(torch.stack(row, dim=-1))
    return torch.stack(rows, dim=-2)


def correlation_by_loop(lidar: Tensor, image: Tensor, radius: int, groups: int) -> Tensor:
    """The definition: one shifted product after the other."""
    volume = []
    for dy in range(-radius, radius + 1):
        for dx in range(-radius, radius + 1):
            product = lidar * shifted(image, dy, dx)
            volume.append(product.unflatten(1, (groups, -1)).sum(2).permute(0, 2, 3, 1))
    return torch.stack(volume, dim=1).unflatten(1, (2 * radius + 1, 2 * radius + 1))


@pytest.mark.parametrize(
    ("radius", "groups", "size"), [(2, 1, (3, 5)), (2, 3, (4, 3)), (4, 2, (2, 6)), (1, 6, (1, 1)), (2, 2, (2, 35))]
)
def test_correlation_equals_a_loop_of_shifted_products(radius: int, groups: int, size: tuple[int, int]) -> None:
    torch.manual_seed(0)
    lidar, image = torch.randn(2, 2, 6, *size, dtype=torch.float64).requires_grad_().unbind()
    fast, slow = correlate(lidar, image, radius, groups), correlation_by_loop(lidar, image, radius, groups)
    assert fast.shape == (2, 2 * radius + 1, 2 * radius + 1, *size, groups)
    torch.testing.assert_close(fast, slow)
    weights = torch.randn_like(fast)
    mine = torch.autograd.grad((fast * weights).sum(), (lidar, image))
    theirs = torch.autograd.grad((slow * weights).sum(), (lidar, image))
    torch.testing.assert_close(mine, theirs)


def test_the_lowest_rows_see_the_image_above_them() -> None:
    generator = torch.Generator().manual_seed(1)
    lidar, image = torch.randn(2, 2, 6, 5, 7, generator=generator)
    low = lidar[:, :, 3:]
    torch.testing.assert_close(correlate(low, image, 2, 3), correlate(lidar, image, 2, 3)[:, :, :, 3:])
    for part, whole in zip(concatenation_volume(low, image, 2), concatenation_volume(lidar, image, 2), strict=True):
        torch.testing.assert_close(part, whole[..., 3:, :])


def test_correlation_gradients_are_those_of_finite_differences() -> None:
    torch.manual_seed(0)
    lidar, image = (torch.randn(1, 4, 2, 3, dtype=torch.float64, requires_grad=True) for _ in range(2))
    assert torch.autograd.gradcheck(lambda a, b: correlate(a, b, 2, 2), (lidar, image))


def test_best_match_names_where_the_image_has_the_lidar_cell() -> None:
    torch.manual_seed(0)
    image = torch.randn(1, 32, 9, 9)
    dy, dx = -2, 1
    lidar = shifted(image, dy, dx)  # lidar cell (y, x) looks like image cell (y - 2, x + 1)
    score = correlate(lidar, image, 2, 4).sum(-1)[0, :, :, 4, 4]
    assert window_offsets(2, 8, score.device)[score.argmax()].tolist() == [8 * dx, 8 * dy]


def test_pairs_equal_a_loop() -> None:
    torch.manual_seed(0)
    lidar, image = torch.randn(2, 2, 3, 4, 5, dtype=torch.float64)
    volume = torch.cat(concatenation_volume(lidar, image, 2), dim=1)
    assert volume.shape == (2, 6, 5, 5, 4, 5)
    for dy in range(-2, 3):
        for dx in range(-2, 3):
            torch.testing.assert_close(volume[:, :, dy + 2, dx + 2], torch.cat([lidar, shifted(image, dy, dx)], dim=1))


def test_score_is_a_cosine_whatever_the_features_length() -> None:
    torch.manual_seed(0)
    features = 30.0 * torch.randn(1, TINY.feature_channels, 4, 6)
    volume, score = CostVolume(TINY)(features, features)
    assert volume.shape == (1, 5, 5, 4, 6, TINY.groups + 2 * TINY.concat_channels)
    assert score.abs().max() <= 1 + 1e-5
    torch.testing.assert_close(score[:, 12], torch.ones(1, 4, 6))  # the centre of the window: itself


def test_what_inference_leaves_behind_can_be_trained_with() -> None:
    features = torch.randn(1, 4, 3, 13)
    with torch.inference_mode():
        correlate(features, features, 2, 2)
    lidar = features.clone().requires_grad_()
    correlate(lidar, features, 2, 2).sum().backward()
    assert lidar.grad is not None
