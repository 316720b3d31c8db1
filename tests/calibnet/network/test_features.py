from __future__ import annotations

from dataclasses import replace

import pytest
import torch
import torch.nn.functional as F

from calibnet.errors import ConfigError
from calibnet.network import efficientnet
from calibnet.network.channels import image_channels, lidar_channels
from calibnet.network.convolution import HAS_ONEDNN, pack
from calibnet.network.features import FeatureExtractor
from calibnet.network.layers import group_count, norm2d
from tests.support.tiny import TINY


def test_groups_of_the_normalisation_divide_the_channels() -> None:
    assert [group_count(channels) for channels in (64, 24, 20, 6, 7, 1)] == [8, 8, 4, 2, 1, 1]
    assert isinstance(norm2d("group", 20), torch.nn.GroupNorm)
    assert isinstance(norm2d("batch", 20), torch.nn.BatchNorm2d)


def test_lidar_channels_are_zero_without_points() -> None:
    assert lidar_channels(torch.zeros(1, 2, 8, 8)).abs().max() == 0


def test_lidar_channels_hold_inverse_depth_and_spread_the_nearest_point() -> None:
    lidar = torch.zeros(1, 2, 16, 16)
    lidar[0, :, 5, 5] = torch.tensor([8.0, 0.5])
    lidar[0, :, 6, 6] = torch.tensor([2.0, 0.25])
    inverse, logarithm, occupied, intensity, near, wide = lidar_channels(lidar)[0]
    assert inverse[5, 5] == 0.5 and inverse[6, 6] == 2.0 and inverse.count_nonzero() == 2
    assert logarithm[5, 5] > logarithm[6, 6]
    assert occupied.sum() == 2 and intensity[5, 5] == 0.5
    assert near[5, 5] == 2.0, "the nearer neighbour wins"
    assert near[3, 4] == 0.5 and near[2, 4] == 0.0 and near[5, 3] == 0.0, "5 rows and 3 columns"
    assert wide[6 + 2 + 3, 6 + 1 + 2] == 2.0 and wide[6 + 2 + 4, 6] == 0.0


def test_lidar_channels_bound_points_nearer_than_a_metre() -> None:
    lidar = torch.zeros(1, 2, 4, 4)
    lidar[0, 0, 1, 1] = 0.05
    assert lidar_channels(lidar)[0, 0, 1, 1] == 4.0


def test_what_goes_into_a_network_is_made_in_the_precision_of_its_convolutions_and_is_the_same() -> None:
    generator = torch.Generator().manual_seed(0)
    lidar = torch.rand(1, 2, 24, 40, generator=generator) * torch.tensor([60.0, 1.0])[:, None, None]
    lidar *= torch.rand(1, 1, 24, 40, generator=generator) < 0.1
    image = torch.arange(256, dtype=torch.uint8).view(1, 1, 16, 16).expand(1, 3, 16, 16)
    for made, given in ((lidar_channels, lidar), (image_channels, image)):
        fine = made(given)
        with torch.autocast("cpu", torch.bfloat16):
            coarse = made(given)
        assert (fine.dtype, coarse.dtype) == (torch.float32, torch.bfloat16)
        assert coarse.equal(fine.bfloat16())


@pytest.mark.parametrize("multi_scale", [True, False])
@pytest.mark.parametrize("volumes", [True, False])
def test_one_feature_map_per_volume(multi_scale: bool, volumes: bool) -> None:
    config = replace(TINY, multi_scale_features=multi_scale, multi_scale_volumes=volumes)
    extractor = FeatureExtractor(config).eval()
    image, lidar = torch.zeros(1, 3, 64, 96), torch.zeros(1, 2, 64, 96)
    expected = [(1, 16, 8, 12), (1, 16, 4, 6), (1, 16, 2, 3)][: 3 if volumes else 1]
    for features in (extractor.image(image), extractor.lidar(lidar)):
        assert [tuple(feature.shape) for feature in features] == expected


def test_a_shared_extractor_has_one_trunk() -> None:
    def parameters(share: bool) -> int:
        return sum(p.numel() for p in FeatureExtractor(replace(TINY, share_extractor=share)).parameters())

    trunk = sum(p.numel() for p in FeatureExtractor(TINY).image_trunk.parameters())
    assert parameters(False) - parameters(True) == trunk


def test_every_scale_sees_the_context_of_the_coarser_ones() -> None:
    extractor = FeatureExtractor(TINY).eval()
    image = torch.zeros(1, 3, 128, 128)
    changed = image.clone()
    changed[:, :, 120:, 120:] = 255.0
    difference = extractor.image(image)[0] - extractor.image(changed)[0]
    assert difference[:, :, 8, 8].abs().max() > 0, "a cell 56 px away, beyond the receptive field at 1/8"


PRETRAINED = replace(TINY, image_encoder="efficientnet-lite0", widths=(8, 8, 16, 16, 24))


@pytest.mark.parametrize("multi_scale", [True, False])
def test_the_pretrained_encoder_feeds_the_same_pyramid(multi_scale: bool) -> None:
    extractor = FeatureExtractor(replace(PRETRAINED, multi_scale_features=multi_scale)).eval()
    extractor.load_pretrained()
    features = extractor.image(torch.zeros(2, 3, 64, 96, dtype=torch.uint8))
    assert [tuple(feature.shape) for feature in features] == [(2, 16, 8, 12), (2, 16, 4, 6), (2, 16, 2, 3)]
    assert len(extractor.pretrained_levels()) == 4


def test_without_multi_scale_features_all_scales_are_one_feature_map() -> None:
    extractor = FeatureExtractor(replace(TINY, multi_scale_features=False)).eval()
    for project in extractor.image_trunk.project:
        project.load_state_dict(extractor.image_trunk.project[0].state_dict())
    image = torch.rand(1, 3, 64, 96, generator=torch.Generator().manual_seed(0)) * 255
    fine, middle, coarse = extractor.image(image)
    torch.testing.assert_close(F.interpolate(coarse, scale_factor=2.0, mode="bilinear"), middle)
    torch.testing.assert_close(F.interpolate(coarse, scale_factor=4.0, mode="bilinear"), fine)


def test_the_pretrained_levels_have_the_widths_they_promise_and_outputs_of_unit_size() -> None:
    extractor = FeatureExtractor(PRETRAINED)
    extractor.load_pretrained()
    x = torch.nn.functional.interpolate(torch.randn(1, 3, 8, 16, generator=torch.Generator().manual_seed(1)), (64, 128))
    for level, width in zip(extractor.pretrained_levels(), efficientnet.WIDTHS, strict=True):
        x = level(x)
        assert x.shape[1] == width
        assert 0.3 < x.std() < 3.0, "the file holds outputs scaled to about unit variance"
    assert x.shape[-2:] == (4, 8)


def test_random_levels_become_the_pretrained_ones_and_nothing_else_changes() -> None:
    torch.manual_seed(4)
    extractor = FeatureExtractor(PRETRAINED)
    before = {name: parameter.clone() for name, parameter in extractor.named_parameters()}
    extractor.load_pretrained()
    changed = {name for name, parameter in extractor.named_parameters() if not parameter.equal(before[name])}
    levels = tuple(f"image_trunk.encoder.{level}." for level in range(4))
    assert changed == {name for name in before if name.startswith(levels)}


def test_without_a_pretrained_encoder_there_is_nothing_to_load() -> None:
    extractor = FeatureExtractor(TINY)
    extractor.load_pretrained()
    assert len(extractor.pretrained_levels()) == 0


def test_strided_convolutions_pad_as_tensorflow_does() -> None:
    # TensorFlow pads an even size with stride 2 at its far side only: output 0 sees input 0, 1, 2
    layer = efficientnet.SameConv(1, 1, 3, stride=2)
    with torch.no_grad():
        layer.weight.fill_(1.0)
        layer.bias.zero_()  # type: ignore[union-attr]
        rows = layer(torch.arange(4.0).view(1, 1, 1, 4).expand(1, 1, 4, 4))[0, 0]
    assert rows.tolist() == [[9.0, 15.0], [6.0, 10.0]]


@pytest.mark.skipif(not HAS_ONEDNN, reason="this machine has no oneDNN for x86")
def test_the_image_encoder_says_the_same_packed() -> None:
    levels = torch.nn.Sequential(*efficientnet.efficientnet_levels()[:2]).eval()
    image = torch.randn(1, 3, 32, 48, generator=torch.Generator().manual_seed(3))
    with torch.no_grad():
        plain = levels(image)
        pack(levels, torch.float32)
        torch.testing.assert_close(levels(image), plain, rtol=1e-4, atol=1e-5)


def test_gradients_of_depthwise_convolutions_are_single_precision_under_autocast() -> None:
    torch.manual_seed(2)
    layer = efficientnet.SameConv(8, 8, 3, stride=2, groups=8)
    x = torch.randn(2, 8, 16, 24)
    exact = layer.eval()(x)
    with torch.autocast("cpu", torch.bfloat16):
        fast, careful = layer(x), layer.train()(x)
    assert fast.dtype == torch.bfloat16, "inference takes what is fastest"
    assert careful.equal(exact)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"share_extractor": True}, "share_extractor must be false"),
        ({"widths": (8, 8, 16), "blocks": (0, 0, 1), "scales": (2, 4, 8)}, "at least four widths"),
    ],
)
def test_a_pretrained_encoder_that_cannot_be_is_refused(changes: dict[str, object], sentence: str) -> None:
    with pytest.raises(ConfigError, match=sentence):
        replace(PRETRAINED, **changes)  # type: ignore[arg-type]
