"""The ablation's rows: what they cost, what is said where there are no weights, and errors where there are."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch

from calibnet.errors import ConfigError, WeightsError
from calibnet.evaluation import ablation
from calibnet.evaluation.ablation import measure_ablation
from calibnet.evaluation.published import PUBLISHED_ABLATION
from calibnet.geometry import RANGES
from calibnet.network.network import CalibrationNetwork
from calibnet.training.ablations import ABLATIONS, ablated, ablation_folder
from calibnet.weights import save_network, weights_path
from tests.support.scene import Scenes
from tests.support.tiny import TINY


@pytest.fixture
def tiny_preset(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ablation, "load_preset", lambda name: TINY)
    monkeypatch.setattr("calibnet.cascade.cascade.load_preset", lambda name: TINY)


def save_row(folder: Path, name: str, of: str | None = None, rigs: tuple[str, ...] = ()) -> None:
    """Random weights where those of a row are looked for."""
    torch.manual_seed(0)
    network = CalibrationNetwork(ablated(TINY, of or name), RANGES[2])
    within = ablation_folder(folder, name)
    within.mkdir(parents=True)
    save_network(weights_path("tiny", RANGES[2], within), network, network.state_dict(), {"rigs": rigs, "samples": 64})


def test_rows_are_those_of_the_paper(tiny_preset: None) -> None:
    rows = list(measure_ablation(["tiny"], RANGES[2], None, [], timed=0))
    assert [row["name"] for row in rows] == list(ABLATIONS) == list(PUBLISHED_ABLATION)
    full = rows[-1]
    assert full["parameters"] == sum(p.numel() for p in CalibrationNetwork(TINY, RANGES[2]).parameters())
    for row in rows[:4]:
        assert row["parameters"] < full["parameters"] and row["multiply_adds"] < full["multiply_adds"]
    assert rows[4]["parameters"] == full["parameters"]
    assert all(f"train --preset tiny --ablation {row['name']} --range 5/0.5" in row["why"] for row in rows)


def test_errors_are_of_the_rows_that_have_weights(tiny_preset: None, tmp_path: Path) -> None:
    save_row(tmp_path, "full", rigs=(Scenes(1).rig,))
    save_row(tmp_path, "multi-scale-volumes")
    told = []
    frames = [Scenes(2)]
    for frame in frames[0].frames:  # rows without points above, of which some are no whole cells of the coarsest scale
        frame.points[:] = frame.points[frame.points[:, 2] < 0.1].repeat(9, axis=0)[: len(frame.points)]
    rows = {
        row["name"]: row
        for row in measure_ablation(
            ["tiny"], RANGES[2], tmp_path, frames, 2, 1, 1, lambda row, done, total: told.append((done, total))
        )
    }
    for name, row in rows.items():
        assert row["latency_ms"] > 0
        if name in ("full", "multi-scale-volumes"):
            assert row["runs"] == 4 and row["failed"] == 0 and row["rig"] == frames[0].rig
            assert row["in_rig"] is (name == "full") and row["samples_trained"] == 64
            assert row["rotation_deg"]["mean"] > 0 and row["translation_cm"]["median"] > 0
        else:
            assert row["why"].startswith("Weights ") and "rotation_deg" not in row
    assert told.count((4, 4)) == 2


def test_weights_of_another_row_are_refused(tiny_preset: None, tmp_path: Path) -> None:
    save_row(tmp_path, "aggregation", of="full")
    with pytest.raises(WeightsError, match="has the network of another row"):
        list(measure_ablation(["tiny"], RANGES[2], tmp_path, [Scenes(1)], timed=0))


def test_an_unknown_row_is_named() -> None:
    with pytest.raises(ConfigError, match="'colour' is not a row of the ablation; choose from multi-scale-features"):
        ablated(TINY, "colour")
