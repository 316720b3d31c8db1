from __future__ import annotations

import numpy as np
import pytest

from calibnet.geometry import RANGES, MiscalibrationRange, range_of
from calibnet.training.draws import Draws, draws_of


@pytest.mark.parametrize(
    ("stage", "degrees", "metres", "residual_share"),
    [(1, 20, 1.5, 0.7), (2, 10, 1.0, 0.7), (3, 5, 0.9, 0.4), (4, 2, 0.5, 0.4), (5, 1.5, 0.35, 0.4)],
)
def test_last_stages_are_drawn_wider_in_translation(
    stage: int, degrees: float, metres: float, residual_share: float
) -> None:
    draws = draws_of(RANGES[stage - 1])
    assert draws.range == MiscalibrationRange(degrees, metres)
    assert draws.residual_share == residual_share


def test_a_range_of_one_s_own_is_drawn_as_it_is() -> None:
    own = MiscalibrationRange(7.0, 0.3)
    assert draws_of(own) == Draws(own, 0.7)


def test_draws_fill_their_range_and_some_are_small_in_one_part_alone() -> None:
    draws, generator = Draws(MiscalibrationRange(2.0, 0.5), 0.4), np.random.default_rng(0)
    drawn = [range_of(draws.uniform(generator)) for _ in range(2000)]
    turns = np.array([range_.rotation_deg for range_ in drawn])
    shifts = np.array([range_.translation_m for range_ in drawn])
    assert turns.max() == pytest.approx(2.0, abs=0.02) and shifts.max() == pytest.approx(0.5, abs=0.005)
    assert turns.max() <= 2.001 and shifts.max() <= 0.5001
    # the largest of three uniform numbers is below a quarter in one of 64 draws, and in 0.35 of eased ones
    assert 0.095 < np.mean(turns < 0.5) < 0.135 and 0.095 < np.mean(shifts < 0.125) < 0.135
    assert np.mean((turns < 0.5) & (shifts > 0.25)) > 0.03, "small turns come with large shifts"
