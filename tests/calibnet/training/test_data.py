from __future__ import annotations

from pathlib import Path

import pytest

from calibnet.errors import ConfigError, DatasetError
from calibnet.training import data
from calibnet.training.data import open_data, training_sources
from calibnet.training.options import TrainingOptions
from tests.support.scene import Scenes


@pytest.mark.parametrize("spec", ["", "kitti", "kitti-raw", "kitti-raw:", "/some/where", "argoverse:here"])
def test_data_of_another_form_is_refused(spec: str) -> None:
    with pytest.raises(ConfigError, match=r"DATASET:FOLDER\[:SEQUENCE\].*kitti-raw"):
        open_data(spec)


@pytest.mark.parametrize("dataset", ["kitti-raw", "kitti-odometry", "kitti-object", "folder"])
def test_missing_and_empty_folders_are_named(dataset: str, tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="nowhere"):
        open_data(f"{dataset}:{tmp_path}/nowhere")
    with pytest.raises(DatasetError, match=str(tmp_path)):
        open_data(f"{dataset}:{tmp_path}")


def options(data: list[str], validate: list[str], synthetic: float, seed: int = 0) -> TrainingOptions:
    return TrainingOptions(
        "tiny", "5/0.5", "out", data=data, validate=validate, synthetic=synthetic, scenes=10, seed=seed
    )


def test_there_must_be_something_to_train_on() -> None:
    with pytest.raises(ConfigError, match="--data"):
        training_sources(options([], [], 0.0))


class Named(Scenes):
    def __init__(self, name: str, length: int) -> None:
        super().__init__(length)
        self.name = name


@pytest.fixture
def three_sequences(monkeypatch: pytest.MonkeyPatch) -> None:
    lengths = {"short": 1, "long": 4, "held-out": 2}
    monkeypatch.setattr(
        data,
        "open_data",
        lambda spec: [Named(name, length) for name, length in lengths.items() if spec in (name, "all")],
    )


def test_real_data_share_what_the_synthetic_world_leaves(three_sequences: None) -> None:
    sources, held_out = training_sources(options(["all"], ["held-out"], 0.4))
    weights = {source.sequence.name: source.weight for source in sources}
    assert weights == pytest.approx({"short": 0.2, "long": 0.4, "synthetic/0": 0.4})  # 1 : 2, by the root of the length
    assert [source.synthetic for source in sources] == [False, False, True]
    assert [sequence.name for sequence in held_out] == ["held-out"]


def test_shares_of_nothing_and_all(three_sequences: None) -> None:
    assert [s.sequence.name for s in training_sources(options(["all"], [], 1.0, seed=3))[0]] == ["synthetic/3"]
    assert "synthetic/3" not in [s.sequence.name for s in training_sources(options(["all"], [], 0.0, seed=3))[0]]
