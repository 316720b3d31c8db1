from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calibnet.geometry import MiscalibrationRange, miscalibration, range_of
from calibnet.training.draws import Draws
from calibnet.training.recipe import RECIPE


def test_draws_fill_their_range_and_some_are_small_in_one_part_alone() -> None:
    draws, generator = Draws(MiscalibrationRange(2.0, 0.5), RECIPE.draws), np.random.default_rng(0)
    drawn = [range_of(draws.draw(generator)) for _ in range(2000)]
    turns = np.array([range_.rotation_deg for range_ in drawn])
    shifts = np.array([range_.translation_m for range_ in drawn])
    assert turns.max() == pytest.approx(2.0, abs=0.02) and shifts.max() == pytest.approx(0.5, abs=0.005)
    assert turns.max() <= 2.001 and shifts.max() <= 0.5001
    # the largest of three uniform numbers is below a quarter in one of 64 draws, and in 0.35 of eased ones
    assert 0.095 < np.mean(turns < 0.5) < 0.135 and 0.095 < np.mean(shifts < 0.125) < 0.135
    assert np.mean((turns < 0.5) & (shifts > 0.25)) > 0.03, "small turns come with large shifts"


def test_no_draw_is_small_alone_where_the_recipe_eases_none() -> None:
    draws = Draws(MiscalibrationRange(2.0, 0.5), replace(RECIPE.draws, eased_share=0.0))
    generator = np.random.default_rng(0)
    turns = np.array([range_of(draws.draw(generator)).rotation_deg for _ in range(2000)])
    assert 0.005 < np.mean(turns < 0.5) < 0.03, "one of 64"


def test_residuals_have_their_share_and_are_stretched() -> None:
    residual = miscalibration([0.0, 0.0, 8.0], [0.0, 0.0, 0.0])  # beyond all that is drawn uniformly
    draws = Draws(MiscalibrationRange(1.0, 0.1), RECIPE.draws, [residual], 0.4)
    generator = np.random.default_rng(0)
    turns = np.array([range_of(draws.draw(generator)).rotation_deg for _ in range(2000)])
    of_residual = turns[turns > 2.0]
    assert 0.37 < len(of_residual) / 2000 < 0.43
    assert of_residual.min() == pytest.approx(0.7 * 8, abs=0.05), "frames never trained on leave more behind"
    assert of_residual.max() == pytest.approx(1.8 * 8, abs=0.05)
