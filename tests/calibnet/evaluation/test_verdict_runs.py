"""The stream of runs a verdict is fitted to, and the file that keeps them."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from calibnet.cascade import Cascade, Stage
from calibnet.evaluation.verdict_log import RunLog, collect
from calibnet.evaluation.verdict_runs import RunStream, VerdictRun
from calibnet.geometry import RANGES
from tests.support.scene import Scenes
from tests.support.tiny import tiny_network


def scenes(name: str, length: int) -> Scenes:
    sequence = Scenes(length)
    sequence.name = name
    return sequence


def stream(seed: int = 0) -> RunStream:
    stages = [Stage(number, RANGES[number - 1], tiny_network(seed=number, stage=number)) for number in (4, 5)]
    return RunStream(Cascade(stages), [scenes("a", 3), scenes("b", 2)], seed)


def test_a_run_depends_on_the_seed_and_its_number_alone() -> None:
    one, other = stream(), stream()
    forward = {number: one.run(number) for number in range(8)}
    assert {number: other.run(number) for number in reversed(range(8))} == forward
    assert stream(1).run(0) != forward[0]
    made = [run for run in forward.values() if run is not None]
    assert {run.fault == "none" for run in made} == {True, False} and {run.sequence for run in made} == {"a", "b"}
    plain = next(run for run in made if run.plain)
    assert np.linalg.norm(plain.offset[:3]) * 100 == pytest.approx(plain.translation_cm, rel=0.2)


def test_runs_are_kept_as_they_are_made_and_not_made_again(tmp_path: Path) -> None:
    made: list[int] = []
    truth = stream()
    some = next(run for number in range(20) if (run := truth.run(number)) is not None)

    def run(numbers: Iterable[int]) -> Iterator[VerdictRun | None]:
        for number in numbers:
            made.append(number)
            yield None if number == 2 else replace(some, number=number)

    path, key = tmp_path / "runs.jsonl", {"weights": "abc"}
    time = iter([True, False])
    first = collect(RunLog(path, key), 20, run, go_on=lambda: next(time))
    assert [one.number for one in first] == [0, 1, 3, 4, 5, 6, 7], "a batch, then the time was over"
    with path.open("a") as file:
        whole = json.loads(path.read_text().splitlines()[0])
        for odd in ({"rotation_deg": "far"}, {"offset": [0.0]}, {"information": [[1.0]]}, {"predictors": 7}):
            file.write(json.dumps(whole | {"number": 19, "run": whole["run"] | odd}) + "\n")
        file.write("[" * 100_000 + "\n" + '{"key": "cut sh')
    told: list[int] = []
    everything = collect(RunLog(path, key), 20, run, observer=told.append)
    assert made == list(range(20)) and told == list(range(8, 21)) and len(everything) == 19
    assert everything[:7] == first, "what is read is what was written"
    assert RunLog(path, {"weights": "others"}).known == {}
