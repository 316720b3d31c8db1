"""Charts: round numbers at the axes, every peak kept, drawings that parse."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest

from inspector.report.figures_svg import (
    HEIGHT,
    WIDTH,
    Series,
    histogram,
    line_chart,
    log_limits,
    log_ticks,
    share,
    thinned,
    ticks,
)


@pytest.mark.parametrize(
    ("limits", "whole", "expected"),
    [
        ((0.0, 5.3), False, [0, 1, 2, 3, 4, 5]),
        ((0.0, 0.07), False, [0, 0.02, 0.04, 0.06]),
        ((0.0, 2.12), True, [0, 1, 2]),
        ((3.0, 3.0), True, [3]),
        ((0.0, 4540.0), True, [0, 1000, 2000, 3000, 4000]),
    ],
)
def test_ticks_are_round(limits: tuple[float, float], whole: bool, expected: list[float]) -> None:
    assert ticks(*limits, whole) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("limits", "expected"),
    [
        ((0.15, 6.0), [0.2, 0.5, 1, 2, 5]),
        ((0.009, 30.0), [0.01, 0.1, 1, 10]),
        ((3.0, 4.1), [3.0, 3.2, 3.4, 3.6, 3.8, 4.0]),
    ],
)
def test_ticks_of_a_logarithmic_axis_are_round(limits: tuple[float, float], expected: list[float]) -> None:
    assert log_ticks(*limits) == pytest.approx(expected)


def test_a_logarithmic_axis_shows_small_values_beside_large_ones() -> None:
    limits = log_limits(
        [Series("start", "initial", np.full(3, 20.0)), Series("end", "stage-5", np.array([0.2, 0, 2.0]))]
    )
    assert limits == pytest.approx((0.2 / 1.15, 20.0 * 1.15))
    assert share(2.0, limits, True) == pytest.approx(0.5)
    assert share(0.0, limits, True) == 0.0


def test_long_lines_keep_their_peaks() -> None:
    y = np.zeros(4541)
    y[[17, 3000]] = 9.0, -4.0
    x, thin = thinned(np.arange(4541.0), y)
    assert len(x) <= 600
    assert {17.0, 3000.0} <= set(x)
    assert (thin.max(), thin.min()) == (9.0, -4.0)
    assert (np.diff(x) > 0).all()


def test_charts_are_well_formed_and_stay_inside() -> None:
    series = [Series("<b>", "initial", np.array([0.0, 2.0, 1.0])), Series("stage 3", "stage-3", np.zeros(3))]
    for svg in (line_chart('"curve"', [5, 7, 9], series, "degrees", str), histogram("bars", series, "degrees")):
        root = ElementTree.fromstring(svg)
        for circle in root.iter("circle"):
            assert 0 <= float(circle.attrib["cx"]) <= WIDTH
            assert 0 <= float(circle.attrib["cy"]) <= HEIGHT
        assert "degrees" in "".join(root.itertext())


def test_bars_count_every_frame_once() -> None:
    series = [Series("a", "initial", np.array([0.0, 2.0, 1.0])), Series("b", "stage-3", np.zeros(3))]
    counts = re.findall(r"<title>([ab]): (\d+) frames", histogram("bars", series, "degrees"))
    assert sorted(counts) == [("a", "1")] * 3 + [("b", "3")]
