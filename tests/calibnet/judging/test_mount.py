"""Where a mount was over many drives: stays, moves, drives that stand apart, and how sure that is."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.random import Generator

from calibnet.geometry import miscalibration, pose_error
from calibnet.geometry.se3 import pose_from_vector
from calibnet.geometry.types import Extrinsic
from calibnet.judging.mount import COMMON_DEG, COMMON_M, FEWEST, Finding, difference, excess_of, mount_over
from tests.support.fakes import REFERENCE

COVARIANCE = np.diag([*[0.05**2] * 3, *[np.radians(0.1) ** 2] * 3])
"""5 cm and 0.1° on every axis."""
ELSEWHERE = miscalibration([0.0, 1.5, 0.0], [0.15, 0.0, 0.0]) @ REFERENCE


def found(where: Extrinsic, random: Generator, errors: float = 1.0) -> Finding:
    """A drive that errs as it states, or so many times more."""
    error = errors * random.multivariate_normal(np.zeros(6), COVARIANCE)
    return Finding(pose_from_vector(error) @ where, COVARIANCE)


def test_a_mount_that_stays_is_known_better_than_by_one_drive() -> None:
    random = np.random.default_rng(1)
    drives = [found(REFERENCE, random) for _ in range(40)]
    (stay,) = mount_over(drives, 1.0).stays
    assert stay.members == tuple(range(40))
    error = pose_error(stay.camera_from_lidar, REFERENCE)
    assert error.rotation_deg < 0.06
    assert error.translation_cm < 3.0
    alike = np.repeat([COMMON_M, np.radians(COMMON_DEG)], 3) ** 2
    assert np.diag(stay.covariance) == pytest.approx(np.diag(COVARIANCE) / 40 + alike, rel=0.1)


def test_a_surer_drive_counts_more() -> None:
    shifted = Finding(miscalibration([0.0, 0.0, 0.0], [0.05, 0.0, 0.0]) @ REFERENCE, COVARIANCE)
    sure = Finding(REFERENCE, COVARIANCE / 9)
    (stay,) = mount_over([shifted, sure]).stays
    assert pose_error(stay.camera_from_lidar, REFERENCE).x_cm == pytest.approx(0.5, abs=1e-6)  # a tenth of 5 cm


@pytest.mark.parametrize("at", [3, 5, 7])
def test_a_move_is_found_where_it_was(at: int) -> None:
    random = np.random.default_rng(at)
    drives = [found(ELSEWHERE if number >= at else REFERENCE, random) for number in range(10)]
    before, after = mount_over(drives).stays
    assert before.members == tuple(range(at))
    assert after.members == tuple(range(at, 10))
    turn, shift = difference(before, after)
    assert turn == pytest.approx(1.5, abs=0.25)
    assert shift == pytest.approx(15.0, abs=10.0)
    assert before.is_firm
    assert after.is_firm


def test_a_move_and_back_are_two() -> None:
    random = np.random.default_rng(2)
    drives = [found(ELSEWHERE if 4 <= number < 8 else REFERENCE, random) for number in range(12)]
    assert [len(stay.members) for stay in mount_over(drives).stays] == [4, 4, 4]


@pytest.mark.parametrize("odd", [(4,), (4, 5), (2, 8)])
def test_few_in_a_row_that_say_something_else_stand_apart(odd: tuple[int, ...]) -> None:
    random = np.random.default_rng(3)
    drives = [found(ELSEWHERE if number in odd else REFERENCE, random) for number in range(12)]
    mount = mount_over(drives)
    assert mount.apart == odd
    (stay,) = mount.stays
    assert stay.members == tuple(number for number in range(12) if number not in odd)
    assert mount.stay_of(odd[0]) is None
    assert len(odd) < FEWEST


def test_a_move_that_is_too_small_is_none() -> None:
    little = miscalibration([0.0, 0.25, 0.0], [0.0, 0.0, 0.0]) @ REFERENCE
    sure = COVARIANCE / 400
    drives = [Finding(little if number >= 5 else REFERENCE, sure) for number in range(10)]
    assert len(mount_over(drives).stays) == 1


def test_no_drive_and_one() -> None:
    assert mount_over([]).stays == ()
    (stay,) = mount_over([Finding(REFERENCE, COVARIANCE)]).stays
    assert not stay.is_firm


def test_what_never_moved_is_hardly_ever_seen_to_have() -> None:
    """200 cars whose drives err by 1.4 times what they state, one of ten by four times as much again."""
    random = np.random.default_rng(4)
    fleet = [
        [found(REFERENCE, random, 1.4 * (4.0 if random.random() < 0.1 else 1.0)) for _ in range(random.integers(3, 12))]
        for _ in range(200)
    ]
    excess = excess_of(fleet)
    firm = [[stay for stay in mount_over(drives, excess).stays if stay.is_firm] for drives in fleet]
    assert sum(len(stays) > 1 for stays in firm) <= 1


def test_what_drives_state_too_small_is_seen_in_their_steps() -> None:
    random = np.random.default_rng(5)
    honest = [[found(REFERENCE, random) for _ in range(10)] for _ in range(30)]
    wide = [[found(REFERENCE, random, 2.0) for _ in range(10)] for _ in range(30)]
    moved = [[found(ELSEWHERE if number >= 5 else REFERENCE, random, 2.0) for number in range(10)] for _ in range(30)]
    assert excess_of(honest) == pytest.approx(1.0, abs=0.15)
    assert excess_of(wide) == pytest.approx(4.0, abs=0.6)
    assert excess_of(moved) == pytest.approx(4.0, abs=1.2), "a few moves hardly change the median"
    assert excess_of([]) == 2.0
