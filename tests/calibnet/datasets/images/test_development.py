"""Images of more than eight bits, of floats and of Bayer patterns: what becomes of known levels."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.testing import assert_array_equal

from calibnet.datasets.images.development import BAYER, Development, white_of
from calibnet.datasets.images.files import decode_image, read_image
from calibnet.errors import DatasetError

RAMP = np.linspace(0, 1, 64 * 48).reshape(48, 64)


def write(path: Path, levels: np.ndarray) -> None:
    assert cv2.imwrite(str(path), levels)


@pytest.mark.parametrize("bits", [10, 12, 14, 16])
def test_a_drive_is_scaled_by_the_depth_of_all_its_images(write_layout, bits):
    """The dark image of a 12-bit drive stays dark, though its own levels would fit into 10 bits."""
    layout = write_layout("folder")
    full = (RAMP * ((1 << bits) - 1)).astype(np.uint16)
    for path, share in zip(layout.images, (1.0, 0.2, 0.5), strict=True):
        write(path, (full * share).astype(np.uint16))
    frames = list(layout.open())
    for frame, share in zip(frames, (1.0, 0.2, 0.5), strict=True):
        expected = (full * share).astype(np.uint16) >> (bits - 8)
        assert_array_equal(frame.image, np.repeat(expected[..., None], 3, axis=2))
    assert frames[1].image.max() == pytest.approx(51, abs=1)


@pytest.mark.parametrize(("scale", "white"), [(1.0, 1.0), (200.0, 255.0), (3000.0, 4095.0)])
@pytest.mark.parametrize("channels", [1, 3])
def test_a_tiff_of_floats(write_layout, scale, white, channels):
    layout = write_layout("folder")
    levels = (RAMP * scale).astype(np.float32)
    levels[0, 0], levels[0, 1] = np.nan, -5.0
    colours = levels if channels == 1 else np.stack([levels, levels / 2, levels / 4], axis=-1)
    for path in layout.images:
        path.unlink()
        write(path.with_suffix(".tiff"), colours)
    image = layout.open()[1].image
    expected = np.clip(np.nan_to_num(levels) / white, 0, 1) * 255
    red = image[..., 0] if channels == 1 else image[..., 2]  # OpenCV writes blue first
    assert np.abs(red.astype(float) - expected).max() <= 1.0
    if channels == 3:
        assert np.abs(image[..., 0].astype(float) - expected / 4).max() <= 1.0
    assert image[0, 0, 0] == image[0, 1, 0] == 0


def test_floats_without_a_usual_scale_are_white_where_almost_all_are_darker():
    ramp = np.linspace(0, 1e5, 256 * 256, dtype=np.float32).reshape(256, 256, 1)
    levels = np.repeat(ramp, 3, axis=2)
    levels[0, 0] = 1e9
    assert white_of([levels]) == pytest.approx(99_500, rel=0.02)


@pytest.mark.parametrize("pattern", BAYER)
@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_a_named_pattern_is_demosaiced(write_layout, write_calibration, pattern, kind):
    """A plain orange surface, as a sensor of the pattern sees it, is orange again."""
    layout = write_layout("folder")
    layout.calibration.write_text(write_calibration(bayer=pattern))
    colours = {"r": 200, "g": 120, "b": 40}
    cells = np.array([[colours[pattern[0]], colours[pattern[1]]], [colours[pattern[2]], colours[pattern[3]]]])
    mosaic = np.tile(cells, (24, 32)).astype(kind)
    if kind == np.uint16:
        mosaic = mosaic * np.uint16(16)  # 12 bits
    for path in layout.images:
        write(path, mosaic)
    image = layout.open()[0].image
    assert_array_equal(image[2:-2, 2:-2], np.broadcast_to([200, 120, 40], (44, 60, 3)))


def test_an_image_with_colours_is_not_demosaiced(write_layout, write_calibration):
    layout = write_layout("folder")
    layout.calibration.write_text(write_calibration(bayer="rggb"))
    with pytest.raises(DatasetError, match=r"has colours, although its calibration has 'bayer'; remove that"):
        layout.open()[0]
    layout.calibration.write_text(write_calibration(bayer="rgbg"))
    with pytest.raises(DatasetError, match="bayer is 'rgbg'; give one of rggb, bggr, gbrg, grbg"):
        layout.open()


def test_each_frame_s_size_is_checked_whatever_its_depth(write_layout):
    layout = write_layout("folder")
    for path, kind in zip(layout.images[1:], (np.float32, np.uint16), strict=True):
        path.unlink()
        write(path.with_suffix(".tiff"), (RAMP[:24] * 4000).astype(kind))
    sequence = layout.open()
    assert sequence[0].image.shape == (48, 64, 3)
    for position in (1, 2):
        with pytest.raises(DatasetError, match="is 64x24 but its calibration is for 64x48"):
            sequence[position]


def test_an_image_alone_is_developed_by_itself(tmp_path: Path):
    write(tmp_path / "a.png", (RAMP * 1023).astype(np.uint16))
    assert read_image(tmp_path / "a.png").max() == 255
    assert_array_equal(read_image(tmp_path / "a.png", None, Development(4096.0)).max(), 63)


def test_a_float_tiff_that_is_cut_or_huge_is_one_sentence(tmp_path: Path):
    write(tmp_path / "a.tiff", RAMP.astype(np.float32))
    data = (tmp_path / "a.tiff").read_bytes()
    for end in range(8, len(data), 997):
        try:
            assert decode_image(data[:end]).shape == (48, 64, 3)
        except ValueError as error:
            assert len(str(error)) < 200
