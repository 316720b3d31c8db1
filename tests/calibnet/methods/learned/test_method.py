"""Methods that need weights: which of their networks run, what they show and cost, and what is said where none are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from calibnet.errors import WeightsError
from calibnet.geometry import RANGES, MiscalibrationRange
from calibnet.methods.card import card_of
from calibnet.methods.learned.counting import multiply_adds
from calibnet.methods.registry import open_method
from tests.support.boxes import REFERENCE, boxes
from tests.support.methods import save_random


def test_a_cascaded_method_runs_the_networks_that_are_there(tmp_path: Path) -> None:
    for stage in (1, 3):
        save_random("regnet", RANGES[stage - 1], tmp_path)
    method = open_method("regnet", RANGES[0], weights=tmp_path)
    trace = method.calibrate(boxes(), REFERENCE, detail=True)
    assert [stage.number for stage in trace.stages] == [1, 3]
    np.testing.assert_array_equal(trace.stages[1].before, trace.stages[0].after)
    names = [shown.name for shown in trace.stages[0].exhibits]
    assert names == ["Inverse depth, input of the network", "Image features", "Depth features"]
    assert trace.stages[0].exhibits[0].picture.shape == (256, 512)
    assert not method.calibrate(boxes(), REFERENCE).stages[0].exhibits
    card = card_of(method)
    assert card.samples_trained == 2 * 640 and card.knows("KITTI 2011_09_26, camera 2")
    assert not card.knows("KITTI 2011_09_30, camera 2")
    assert card.parameters == 2 * 16_132_788 and card.multiply_adds == 2 * multiply_adds(method.stages[0].network)  # type: ignore[attr-defined]


def test_a_method_of_one_network_runs_that_of_the_range_as_often_as_its_paper_does(tmp_path: Path) -> None:
    for stage in (3, 4):
        save_random("calibnet", RANGES[stage - 1], tmp_path)
    method = open_method("calibnet", MiscalibrationRange(5, 0.5), weights=tmp_path)
    trace = method.calibrate(boxes(), REFERENCE)
    assert [stage.number for stage in trace.stages] == [3]
    looked_from = trace.stages[0].looked_from
    assert not np.array_equal(looked_from, REFERENCE) and not np.array_equal(looked_from, trace.corrected)


def test_what_is_missing_is_said_with_the_command_that_makes_it(tmp_path: Path) -> None:
    with pytest.raises(WeightsError, match=r"Method lccnet has no weights in the package.* --method lccnet --range 5"):
        open_method("lccnet", RANGES[2])
    save_random("regnet", RANGES[2], tmp_path)
    with pytest.raises(WeightsError, match=rf"Method regnet has no weights for ±20°/1\.5 m in {tmp_path}; make them"):
        open_method("regnet", RANGES[0], weights=tmp_path)
