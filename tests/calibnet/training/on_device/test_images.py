"""Images of a batch look as OpenCV makes them."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from calibnet.training.augmentation import exposed as exposed_by_opencv
from calibnet.training.augmentation_draws import Exposure
from calibnet.training.on_device.draws import Exposures
from calibnet.training.on_device.images import exposed, sampled_at

EXPOSURES = [
    Exposure(),
    Exposure(grey=True, gamma=0.8),
    Exposure(tint=np.array([0.8, 1.1, 1.2]), gamma=1.5, contrast=1.3, brightness=0.1),
    Exposure(blur_px=1.2, contrast=0.7),
    Exposure(blur_px=0.5, brightness=-0.1),
]


def pictures(count: int) -> np.ndarray:
    generator = np.random.default_rng(0)
    return generator.integers(0, 256, (count, 24, 40, 3)).astype(np.uint8)


def test_an_exposure_is_that_of_opencv() -> None:
    images = pictures(len(EXPOSURES))
    batch = torch.from_numpy(images).permute(0, 3, 1, 2).float()
    made = exposed(batch, Exposures.of(EXPOSURES), torch.Generator()).permute(0, 2, 3, 1).numpy()
    for ours, image, exposure in zip(made, images, EXPOSURES, strict=True):
        theirs = exposed_by_opencv(image, exposure, np.random.default_rng())
        assert np.abs(ours.astype(int) - theirs).max() <= 1
        assert (ours != theirs).mean() < 0.03 or exposure is EXPOSURES[0], "which OpenCV's path never draws"
    assert np.array_equal(made[0], images[0])


def test_noise_is_as_strong_as_it_was_drawn() -> None:
    grey = torch.full((2, 3, 100, 100), 128.0)
    made = exposed(grey, Exposures.of([Exposure(noise=0.04), Exposure(noise=0.01)]), torch.Generator().manual_seed(3))
    strength = made.float().std((1, 2, 3)) / 255
    assert strength.tolist() == pytest.approx([0.04, 0.01], rel=0.05)


@pytest.mark.parametrize("count", [2, 3])
def test_samples_of_a_pixel_spread_as_averaging_and_interpolating_do(count: int) -> None:
    places = sampled_at(torch.tensor([0.8, 1.0, 2.0, 2.5]), count)
    assert places[0].square().mean() == pytest.approx(1 / 6), "made larger, an image is interpolated twice"
    assert not places[1].any(), "and once where it keeps its size"
    np.testing.assert_allclose(places.mean(1), 0, atol=1e-6)
    variance = places.square().mean(1)[2:] + 1 / 6 / torch.tensor([2.0, 2.5]) ** 2
    np.testing.assert_allclose(variance, 1 / 12 + 1 / 6, rtol=1e-5)
