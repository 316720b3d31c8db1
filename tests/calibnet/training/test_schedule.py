from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from calibnet.geometry import RANGES, MiscalibrationRange
from calibnet.training.options import TrainingOptions
from calibnet.training.recipe import RECIPE, Step
from calibnet.training.schedule import FEATURES, all_stages
from calibnet.weights import weights_path


def plan(folder: Path, minutes: float | None = None, samples: int | None = None) -> list[TrainingOptions]:
    return all_stages(TrainingOptions(preset="compact", range="", output=str(folder), minutes=minutes, samples=samples))


def weights_of(step: TrainingOptions) -> Path:
    return weights_path(step.preset, MiscalibrationRange.parse(step.range), Path(step.output))


def test_all_ranges_within_the_whole_budget(tmp_path: Path) -> None:
    steps = plan(tmp_path, minutes=100.0)
    assert {weights_of(step) for step in steps if step.output == str(tmp_path)} == {
        weights_path("compact", range_, tmp_path) for range_ in RANGES
    }
    assert sum(step.minutes or 0 for step in steps) == pytest.approx(100.0)
    sampled = plan(tmp_path, samples=1000)
    assert {step.minutes for step in sampled} == {None}
    assert sum(step.samples or 0 for step in sampled) == 1000


def test_every_step_starts_from_one_before_it_and_sees_the_stages_before_it(tmp_path: Path) -> None:
    done: set[Path] = set()
    for step in plan(tmp_path, minutes=1.0):
        if done:
            assert step.initialize is not None and Path(step.initialize) in done
            assert step.after == str(tmp_path)
        else:
            assert step.initialize is None and step.after is None
        assert weights_of(step) not in done, "no step may replace the weights of another: a resumed run skips it then"
        done.add(weights_of(step))


def test_the_stages_before_are_trained_before(tmp_path: Path) -> None:
    final = [step.range for step in plan(tmp_path, minutes=1.0) if step.output == str(tmp_path)]
    assert final == [str(range_) for range_ in RANGES]


def test_finished_steps_are_not_trained_again(tmp_path: Path) -> None:
    assert len(plan(tmp_path, minutes=1.0)) == 6
    weights_path("compact", RANGES[2], tmp_path / FEATURES).parent.mkdir()
    weights_path("compact", RANGES[2], tmp_path / FEATURES).touch()
    for range_ in RANGES[:2]:
        weights_path("compact", range_, tmp_path).touch()
    assert [step.range for step in plan(tmp_path, minutes=1.0)] == ["5/0.5", "2/0.2", "1/0.1"]


def test_the_schedule_is_the_recipe_s(tmp_path: Path) -> None:
    options = TrainingOptions(preset="compact", range="", output=str(tmp_path), minutes=100.0, learning_rate=1e-3)
    steps = (Step(RANGES[0], 0.75, None, 1.0), Step(RANGES[1], 0.25, RANGES[0], 0.1))
    first, second = all_stages(options, replace(RECIPE, schedule=steps))
    assert (first.range, first.minutes, first.learning_rate, first.initialize) == ("20/1.5", 75.0, 1e-3, None)
    assert (second.range, second.minutes, second.learning_rate) == ("10/1", 25.0, pytest.approx(1e-4))
    assert second.initialize == str(weights_of(first))
