from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from calibnet.geometry import RANGES
from calibnet.training.options import TrainingOptions
from calibnet.training.schedule import SCHEDULE, all_stages
from calibnet.weights import weights_path


def test_all_ranges_once_within_the_whole_budget(tmp_path: Path) -> None:
    options = TrainingOptions(preset="compact", range="", output=str(tmp_path), minutes=100.0)
    steps = all_stages(options)
    assert sorted(step.range for step in steps) == sorted(map(str, RANGES))
    assert sum(step.minutes or 0 for step in steps) == pytest.approx(100.0)
    sampled = all_stages(replace(options, minutes=None, samples=1000))
    assert [step.minutes for step in sampled] == [None] * 5
    assert sum(step.samples or 0 for step in sampled) == 1000


def test_every_stage_starts_from_one_that_is_trained_before_it(tmp_path: Path) -> None:
    options = TrainingOptions(preset="compact", range="", output=str(tmp_path), minutes=1.0)
    done: set[str] = set()
    for step, planned in zip(all_stages(options), SCHEDULE, strict=True):
        assert (step.initialize is None) == (not done)
        assert step.initialize is None or step.initialize in done
        done.add(str(weights_path("compact", planned.bounds, tmp_path)))


def test_finished_stages_are_not_trained_again(tmp_path: Path) -> None:
    for bounds in RANGES[:3]:
        weights_path("compact", bounds, tmp_path).touch()
    steps = all_stages(TrainingOptions(preset="compact", range="", output=str(tmp_path), minutes=1.0))
    assert [step.range for step in steps] == ["2/0.2", "1/0.1"]
