"""Captions and legends as pictures, and the map of displacements in fractions of a cell."""

from __future__ import annotations

import io

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from calibnet.trace import ScaleTrace
from inspector import colors
from inspector.record.pictures.captions import caption_strip
from inspector.record.pictures.lettering import bar_png, font, letter_width, names_png, text_png
from inspector.record.pictures.maps import (
    LOGIT_SCALE,
    decidedness,
    mass_on_truth,
    matching_probability,
    subcell_match,
    within_window,
)


def test_words_have_their_own_ground_and_fit() -> None:
    """A light viewer writes labels on a light ground: white ones vanish."""
    size = (310, 24)
    short, long = (decoded(text_png([text], size, 18, (255, 110, 100))) for text in ("off", "rejected, " * 9))
    for picture in (short, long):
        assert picture.shape == (24, 310, 3)
        assert tuple(picture[0, 0]) == colors.GROUND
    assert tuple(short.reshape(-1, 3).max(axis=0)) == (255, 110, 100)
    assert (long[:, [0, -1]] == colors.GROUND).all()  # made smaller, not cut
    across = np.flatnonzero((short != colors.GROUND).any(axis=(0, 2)))
    assert abs(across.mean() - size[0] / 2) < 2


def test_letters_that_legends_use_exist_in_the_font() -> None:
    missing = font(20).getmask("\uffff").getbbox(), bytes(font(20).getmask("\uffff"))
    for letter in "°±,.:-0m%":
        mask = font(20).getmask(letter)
        assert (mask.getbbox(), bytes(mask)) != missing, letter


def test_labels_on_a_bar_stand_out_from_it() -> None:
    strip = np.repeat(np.array([[0, 0, 60], [250, 250, 120]], np.uint8), 200, axis=0)
    picture = decoded(bar_png(strip, {0.25: "dark", 0.75: "bright"}, 40))
    assert picture[:, :200].max() == 255 and picture[:, 200:].min() == 0


def test_names_stand_after_dots_in_their_colours() -> None:
    picture = decoded(names_png([("stage 3", (190, 130, 255)), ("stage 5", (80, 220, 110))], 40))
    first, second = picture[:, : picture.shape[1] // 2], picture[:, picture.shape[1] // 2 :]
    for half, color in ((first, (190, 130, 255)), (second, (80, 220, 110))):
        assert (np.abs(half.astype(int) - color).sum(axis=2) < 30).sum() > 50


@pytest.mark.parametrize(("image", "lines"), [((1242, 375), 1), ((1600, 900), 2), ((376, 1241), 2)])
def test_a_caption_has_room_for_its_longest_line(image: tuple[int, int], lines: int) -> None:
    strip = caption_strip(image)
    assert strip.lines == lines
    longest = "corrected, cannot tell: 12.34°, 123.4 cm off" if lines == 1 else "corrected, cannot tell"
    if image[0] > image[1]:
        assert letter_width(longest, strip.letters) <= image[0]


def test_the_most_probable_displacement_has_fractions_of_a_cell() -> None:
    probability = np.zeros((3, 5, 1, 2), np.float16)
    probability[1, 2, 0, 0], probability[1, 3, 0, 0] = 0.75, 0.25  # a quarter to the right
    probability[0, 4, 0, 1], probability[1, 4, 0, 1] = 0.5, 0.5  # in the corner of the window, half a cell below
    best = np.array([[[0, 0], [2, -1]]])
    scale = ScaleTrace(8, probability, probability, best, probability[0], probability[0], np.ones((1, 2), bool))
    np.testing.assert_allclose(subcell_match(scale)[0], [[0.25, 0.0], [2.0, -0.5]], atol=1e-3)


def test_cells_are_decided_where_one_displacement_has_all_probability() -> None:
    sure, half, none = np.zeros((3, 4), np.float16), np.zeros((3, 4), np.float16), np.full((3, 4), 1 / 12, np.float16)
    sure[1, 2], half[0, :2] = 1.0, 0.5
    found = decidedness(np.stack([sure, half, none], axis=-1)[:, :, None])
    np.testing.assert_allclose(found, [[1.0, 1 - np.log(2) / np.log(12), 0.0]], atol=2e-3)


def test_mass_on_the_truth_is_what_lies_within_a_cell_of_it() -> None:
    probability = np.full((3, 5, 1, 4), 1 / 15, np.float16)
    probability[..., 1] = 0.0
    probability[0, 0, 0, 1], probability[2, 4, 0, 1] = 0.75, 0.25  # two corners of the window
    true = np.array([[[0.0, 0.0], [1.5, 0.5], [-1.5, 0.0], [9.0, 0.0]]])  # on a cell, near a corner, between cells, out
    np.testing.assert_allclose(mass_on_truth(probability, true), [[9 / 15, 0.25, 6 / 15, 0.0]], atol=2e-3)
    scale = ScaleTrace(8, probability, probability, true, probability[0], probability[0], np.ones((1, 4), bool))
    assert within_window(scale, true).tolist() == [[True, True, True, False]]


def test_before_aggregation_the_scores_are_weighed_as_the_network_does() -> None:
    from calibnet.network import cost_volume

    assert LOGIT_SCALE == cost_volume.LOGIT_SCALE
    volume = np.zeros((1, 3, 1, 1), np.float16)
    volume[0, 1] = 0.5
    scale = ScaleTrace(8, volume, volume, np.zeros((1, 1, 2), np.int64), volume[0], volume[0], np.ones((1, 1), bool))
    found = matching_probability(scale)[0, :, 0, 0]
    np.testing.assert_allclose(found, np.exp([0.0, 7.0, 0.0]) / (2 + np.exp(7.0)), rtol=1e-3)


def decoded(png: bytes) -> NDArray[np.uint8]:
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB"))
