"""Images of messages, raw and compressed, in their encodings."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from calibnet.datasets.bag.messages import levels_of
from calibnet.datasets.images.development import Development, ImageError
from tests.support.bags import BagWriter
from tests.support.fakes import make_frame

RGB = make_frame(1, width=128, height=48).image


@pytest.mark.parametrize(
    ("encoding", "stored"),
    [
        ("rgb8", RGB),
        ("bgr8", RGB[..., ::-1]),
        ("bgra8", np.dstack([RGB[..., ::-1], RGB[..., 0]])),
        ("rgb16", RGB.astype(np.uint16) << 8),
    ],
)
def test_raw_images_of_colour(encoding: str, stored: np.ndarray, tmp_path: Path) -> None:
    message = BagWriter(tmp_path / "a", "mcap").raw(stored, encoding, 1.0)
    assert_array_equal(Development()(levels_of(message)), RGB)


@pytest.mark.parametrize("pattern", ["rggb", "bggr", "gbrg", "grbg"])
def test_bayer_patterns_have_the_names_of_ros(pattern: str, tmp_path: Path) -> None:
    """A red image: only the red cells of the pattern are bright."""
    mosaic = np.zeros((32, 32), np.uint8)
    row, column = divmod(pattern.index("r"), 2)
    mosaic[row::2, column::2] = 200
    picture = levels_of(BagWriter(tmp_path / "a", "mcap").raw(mosaic, f"bayer_{pattern}8", 1.0))
    assert_allclose(picture[4:-4, 4:-4].reshape(-1, 3).mean(axis=0), [200, 0, 0], atol=1)


def test_a_grey_image_of_twelve_bits(tmp_path: Path) -> None:
    grey = (np.arange(64, dtype=np.uint16) * 64).reshape(8, 8)
    bag = BagWriter(tmp_path / "a", "mcap")
    expected = np.repeat((grey >> 4).astype(np.uint8)[..., None], 3, axis=2)
    assert_array_equal(Development()(levels_of(bag.raw(grey, "mono16", 1.0))), expected)
    other_way_round = bag.raw(grey.astype(">u2"), "mono16", 1.0, bigendian=True)
    assert_array_equal(Development()(levels_of(other_way_round)), expected)


def compressed(folder: Path, image: np.ndarray, form: str) -> np.ndarray:
    """What is read of an image that was packed as PNG, with a format like those that ROS writes."""
    message = BagWriter(folder / "a", "mcap").compressed(image, 1.0)
    message.format, message.data = form, cv2.imencode(".png", image)[1].reshape(-1)
    return levels_of(message)


@pytest.mark.parametrize("pattern", ["rggb", "bggr", "gbrg", "grbg"])
@pytest.mark.parametrize("depth", [8, 16])
def test_a_mosaic_is_developed_where_the_format_says_that_it_is_one(pattern: str, depth: int, tmp_path: Path) -> None:
    mosaic = np.zeros((32, 32), np.uint8 if depth == 8 else np.uint16)
    row, column = divmod(pattern.index("r"), 2)
    mosaic[row::2, column::2] = 200
    picture = compressed(tmp_path, mosaic, f"bayer_{pattern}{depth}; png compressed ")
    assert picture.dtype == mosaic.dtype
    assert_allclose(picture[4:-4, 4:-4].reshape(-1, 3).mean(axis=0), [200, 0, 0], atol=1)


@pytest.mark.parametrize("form", ["png", "mono8; png compressed ", "bayer_rggb8; png compressed mono8"])
def test_another_grey_image_is_not_a_mosaic(form: str, tmp_path: Path) -> None:
    grey = np.random.default_rng(0).integers(0, 256, (8, 8)).astype(np.uint8)
    assert_array_equal(compressed(tmp_path, grey, form), np.repeat(grey[..., None], 3, axis=2))


def test_a_mosaic_that_was_developed_before_it_was_packed_stays_as_it_is(tmp_path: Path) -> None:
    assert_array_equal(compressed(tmp_path, RGB[..., ::-1], "bayer_rggb8; png compressed bgr8"), RGB)


def test_depths_are_not_an_image(tmp_path: Path) -> None:
    with pytest.raises(ImageError, match="has depths, not colours"):
        compressed(tmp_path, np.ones((8, 8), np.uint16), "16UC1; compressedDepth png")


def test_a_video_is_not_an_image(tmp_path: Path) -> None:
    with pytest.raises(ImageError, match=r"part of a video \(h264\)"):
        compressed(tmp_path, RGB, "h264")
