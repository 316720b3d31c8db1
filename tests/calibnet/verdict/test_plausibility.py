from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calibnet.datasets.frame import Frame
from calibnet.datasets.synthetic import KITTI_LIKE, SyntheticSequence
from calibnet.evaluation import corruptions as faults
from calibnet.verdict.plausibility import implausible, is_blank


@pytest.fixture(scope="module")
def frame() -> Frame:
    """Of the synthetic world, which is as it should be."""
    return SyntheticSequence(seed=4, length=1, rig=KITTI_LIKE)[0]


def names(frame: Frame) -> list[str]:
    return [cause.name for cause in implausible(frame)]


def test_nothing_is_wrong_with_what_is_right(frame: Frame) -> None:
    assert names(frame) == [] and not is_blank(frame)
    for harmless in (
        faults.blurred(10),
        faults.exposed(8),
        faults.thinned(8),
        faults.focal(1.1),
        faults.principal(60, 0),
    ):
        assert names(harmless(frame)) == []
    for seed in range(20, 23):
        assert names(SyntheticSequence(seed=seed, length=1)[0]) == []


@pytest.mark.parametrize(
    ("alter", "name", "said"),
    [
        (faults.high_byte(12), "bit-depth", "of 255"),
        (faults.high_byte(10), "bit-depth", "of 255"),
        (faults.low_byte(12, 0), "bit-depth", "neighbouring pixels"),
        (faults.matrix_of_size(0.5), "picture-size", "1242x375"),
        (faults.matrix_of_size(2.0), "picture-size", "1242x375"),
        (faults.scaled_scan(1000.0), "units", "farther"),
        (faults.scaled_scan(0.001), "units", "nearer"),
        (faults.focal(0.1), "focal-length", "72 px"),
        (faults.turned(faults.AXES["x right, y down, z forward"]), "axes", "one plane there"),
    ],
)
def test_what_cannot_be_is_named(frame: Frame, alter: faults.Alteration, name: str, said: str) -> None:
    altered = alter(frame)
    assert names(altered) == [name]
    assert said in implausible(altered)[0].evidence


def test_a_scan_upside_down_may_be_turned_or_left_handed(frame: Frame) -> None:
    assert names(faults.flipped(2)(frame)) == ["axes", "left-handed"]


def test_what_is_said_of_units_and_sizes_is_what_to_do(frame: Frame) -> None:
    assert "in millimetres; give it in metres" in implausible(faults.scaled_scan(1000.0)(frame))[0].text
    assert "in kilometres" in implausible(faults.scaled_scan(0.001)(frame))[0].text
    text = implausible(faults.matrix_of_size(0.5)(frame))[0].text
    width = int(text.split("about ")[1].split("x")[0])
    assert width == pytest.approx(621, rel=0.05)


def test_a_principal_point_near_the_border_is_no_matrix_of_another_size(frame: Frame) -> None:
    assert names(faults.principal(400, 0)(frame)) == ["principal-point"]


def test_a_picture_of_one_grey_is_blank_and_not_dark(frame: Frame) -> None:
    blank = replace(frame, image=np.full_like(frame.image, 3))
    assert is_blank(blank) and names(blank) == []


def test_few_points_tell_nothing(frame: Frame) -> None:
    assert names(replace(frame, points=frame.points[:0])) == []
