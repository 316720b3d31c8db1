from __future__ import annotations

import math
from dataclasses import replace

import pytest
import torch

from calibnet.network.displacement import DisplacementDecoder, DisplacementField, expected_error, window_offsets
from tests.support.tiny import TINY

CONFIG = replace(TINY, radius=4)  # 32 px are a displacement of the window at 1/8, 1/16 and 1/32 alike
SIZES = ((8, 12), (4, 6), (2, 3))


def peaked(dx: int, dy: int) -> list[torch.Tensor]:
    """Logits ``[1, D, h, w]`` per scale that peak at a displacement given in pixels."""
    logits = []
    for scale, size in zip(CONFIG.scales, SIZES, strict=True):
        window = torch.zeros(1, CONFIG.window, CONFIG.window, *size)
        window[:, dy // scale + CONFIG.radius, dx // scale + CONFIG.radius] = 50.0
        logits.append(window.flatten(1, 2))
    return logits


@pytest.fixture
def decoder() -> DisplacementDecoder:
    torch.manual_seed(0)
    return DisplacementDecoder(CONFIG).eval()


FEATURES, CELLS = torch.ones(1, CONFIG.feature_channels, *SIZES[0]), torch.ones(1, 3, *SIZES[0])


def test_offsets_run_row_by_row_in_pixels() -> None:
    assert window_offsets(1, 16, torch.device("cpu")).tolist() == [
        [-16, -16], [0, -16], [16, -16], [-16, 0], [0, 0], [16, 0], [-16, 16], [0, 16], [16, 16],
    ]  # fmt: skip


@pytest.mark.parametrize(("dx", "dy"), [(0, 0), (32, 0), (0, -32), (-32, 32)])
def test_field_is_where_all_scales_peak(decoder: DisplacementDecoder, dx: int, dy: int) -> None:
    with torch.no_grad():
        decoder.residual.bias.zero_()
        displacement = decoder(peaked(dx, dy), FEATURES, CELLS).displacement
    expected = torch.tensor([dx, dy], dtype=torch.float32)[None, :, None, None].expand(1, 2, *SIZES[0])
    torch.testing.assert_close(displacement, expected, atol=1e-3, rtol=0)


def test_two_equal_peaks_meet_halfway(decoder: DisplacementDecoder) -> None:
    with torch.no_grad():
        decoder.residual.bias.zero_()
        both = [torch.maximum(one, other) for one, other in zip(peaked(32, 0), peaked(0, 32), strict=True)]
        displacement = decoder(both, FEATURES, CELLS).displacement
    torch.testing.assert_close(displacement, torch.full_like(displacement, 16.0), atol=1e-3, rtol=0)


def test_residual_moves_the_field_by_cells_of_the_finest_scale(decoder: DisplacementDecoder) -> None:
    with torch.no_grad():
        decoder.residual.bias.copy_(torch.tensor([0.5, -0.25]))
        displacement = decoder(peaked(0, 0), FEATURES, CELLS).displacement
    torch.testing.assert_close(displacement[0, :, 3, 4], torch.tensor([4.0, -2.0]), atol=1e-3, rtol=0)


def test_expected_error_is_the_geometric_mean_over_occupied_cells_and_axes(decoder: DisplacementDecoder) -> None:
    log_scale = torch.full((2, 2, 2, 3), 9.0)
    cells = torch.zeros(2, 3, 2, 3)
    log_scale[0, :, 0, 1], log_scale[0, :, 1, 2] = torch.tensor([0.0, 1.0]), torch.tensor([2.0, 1.0])
    cells[0, 2, 0, 1] = cells[0, 2, 1, 2] = 10.0
    log_scale[1, :, 1, 0] = math.log(3.0)
    cells[1, 2, 1, 0] = 5.0
    field = DisplacementField(torch.zeros(2, 2, 2, 3), log_scale, torch.zeros(2, 1, 2, 3))
    torch.testing.assert_close(expected_error(field, cells), torch.tensor([math.e, 3.0]))
    assert expected_error(field, torch.zeros_like(cells)).isnan().all()


def test_field_starts_unsure_and_stays_within_bounds(decoder: DisplacementDecoder) -> None:
    log_scale = decoder(peaked(0, 0), FEATURES, CELLS).log_scale
    torch.testing.assert_close(log_scale, torch.full_like(log_scale, 2.0))
    for bias, bound in zip((-100.0, 100.0), DisplacementDecoder.LOG_SCALE_BOUNDS, strict=True):
        with torch.no_grad():
            decoder.log_scale.bias.fill_(bias)
            assert (decoder(peaked(0, 0), FEATURES, CELLS).log_scale == bound).all()
