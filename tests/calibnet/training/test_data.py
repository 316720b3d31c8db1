from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from calibnet.errors import ConfigError, DatasetError
from calibnet.training import data
from calibnet.training.data import SyntheticPool, open_data, training_sources
from tests.support.scene import Scenes, make_frame


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


def test_there_must_be_something_to_train_on() -> None:
    with pytest.raises(ConfigError, match="--data"):
        training_sources([], [], 0.0, 10, 0, None)


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
    sources, held_out = training_sources(["all"], ["held-out"], 0.4, 10, 0, None)
    weights = {source.sequence.name: source.weight for source in sources}
    assert weights == pytest.approx({"short": 0.2, "long": 0.4, "synthetic/0": 0.4})  # 1 : 2, by the root of the length
    assert [sequence.name for sequence in held_out] == ["held-out"]


def test_shares_of_nothing_and_all(three_sequences: None) -> None:
    assert [s.sequence.name for s in training_sources(["all"], [], 1.0, 10, 3, None)[0]] == ["synthetic/3"]
    assert "synthetic/3" not in [s.sequence.name for s in training_sources(["all"], [], 0.0, 10, 3, None)[0]]


def test_scenes_are_rendered_once_and_read_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from calibnet.datasets import synthetic

    drawn: list[int] = []

    def sample_frame(seed: int) -> object:
        drawn.append(seed)
        return make_frame(seed % 10)

    monkeypatch.setattr(synthetic, "sample_frame", sample_frame)
    pool = SyntheticPool(5, 2, tmp_path)
    first, again = pool[3], SyntheticPool(5, 2, tmp_path)[3]
    assert drawn == [2_000_003] and len(pool) == 5
    assert np.array_equal(first.image, again.image) and np.array_equal(first.points, again.points)
    assert np.array_equal(first.camera_from_lidar, again.camera_from_lidar)
    assert np.array_equal(first.camera.matrix, again.camera.matrix)
    assert (again.camera.width, again.camera.height) == (first.camera.width, first.camera.height)


@pytest.mark.parametrize("keep", [0, 10, 3000, -1])
def test_a_scene_cut_short_is_drawn_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, keep: int) -> None:
    from calibnet.datasets import synthetic

    monkeypatch.setattr(synthetic, "sample_frame", lambda seed: make_frame(1))
    pool = SyntheticPool(5, 2, tmp_path)
    expected = pool[0].points
    (file,) = tmp_path.iterdir()
    file.write_bytes(file.read_bytes()[:keep])
    assert np.array_equal(pool[0].points, expected)
