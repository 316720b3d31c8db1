"""What the cascade costs in the table of methods: as the other methods, with its looks and at its sizes of image."""

from __future__ import annotations

import pytest

from calibnet.cascade import Cascade, Stage
from calibnet.evaluation import bench_methods
from calibnet.evaluation.bench_methods import cascade_card
from calibnet.evaluation.counting import ModuleCost, count
from calibnet.geometry import RANGES
from calibnet.weights.manifest import StageSettings
from tests.support.tiny import TINY, tiny_network

HEIGHT, WIDTH = TINY.input_height, TINY.input_width


@pytest.fixture(autouse=True)
def records(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench_methods, "weights_path", lambda preset, range_, folder: range_)
    monkeypatch.setattr(bench_methods, "read_record", lambda range_: {"samples": 10, "rigs": [f"rig of {range_}"]})


def stage(number: int, size: float = 1.0, looks: int = 1, branch: int = 0) -> Stage:
    """A stage with an image branch of its own, or that of others with the same number."""
    network, shared = tiny_network(seed=number, stage=number), tiny_network(seed=100 + branch)
    image = {name: t for name, t in shared.state_dict().items() if name.startswith("features.image_")}
    network.load_state_dict(network.state_dict() | image)
    return Stage(number, RANGES[number - 1], network, StageSettings(size, looks, 1.0))


def costs(size: float = 1.0) -> tuple[ModuleCost, list[ModuleCost]]:
    image, *others = count(tiny_network(), round(size * HEIGHT), round(size * WIDTH))
    return image, others


def card(*stages: Stage) -> tuple[int, int]:
    found = cascade_card(Cascade(stages), "tiny", None)
    assert found.samples_trained == 10 * len(stages)
    return found.parameters, found.multiply_adds


def test_work_grows_with_the_looks_and_the_image_is_seen_once() -> None:
    image, others = costs()
    look, own = sum(cost.multiply_adds for cost in others), sum(cost.parameters for cost in others)
    assert card(stage(4, looks=3)) == (image.parameters + own, image.multiply_adds + 3 * look)


def test_work_is_that_at_the_size_of_the_stage_s_image() -> None:
    image, others = costs(2.0)
    assert card(stage(4, size=2.0))[1] == image.multiply_adds + sum(cost.multiply_adds for cost in others)


def test_an_image_branch_that_stages_share_counts_once_at_each_size() -> None:
    image, others = costs()
    larger, of_larger = costs(2.0)
    look, own = sum(cost.multiply_adds for cost in others), sum(cost.parameters for cost in others)
    shared = card(stage(3), stage(4))
    assert shared == (image.parameters + 2 * own, image.multiply_adds + 2 * look)
    apart = card(stage(3), stage(4, branch=1))
    assert apart == (2 * image.parameters + 2 * own, 2 * image.multiply_adds + 2 * look)
    two_sizes = card(stage(3), stage(4, size=2.0))
    expected = image.multiply_adds + larger.multiply_adds + look + sum(cost.multiply_adds for cost in of_larger)
    assert two_sizes == (image.parameters + 2 * own, expected)
