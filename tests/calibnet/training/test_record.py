from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from lightning_fabric import Fabric

from calibnet.cascade.stage import Stage
from calibnet.geometry import RANGES, MiscalibrationRange, miscalibration
from calibnet.training.build import Training, inherited_licence
from calibnet.training.data import Source
from calibnet.training.draws import Draws
from calibnet.training.frames import TrainingFrames
from calibnet.training.options import TrainingOptions
from calibnet.training.recipe import RECIPE, Recipe
from calibnet.training.record import licence_note, manifest_with, recipe_sentence, training_record
from calibnet.training.samples import TrainingSamples
from calibnet.training.validation import ValidationFigures
from calibnet.weights import save_network
from calibnet.weights.manifest import Manifest, StageEntry, StageSettings, load_manifest, manifest_path
from tests.support.scene import Scenes
from tests.support.tiny import tiny_network

SHIPPED = "Trained on KITTI (CC BY-NC-SA 3.0)."
FIGURES = ValidationFigures(4.7, 48.0, 1.2, 20.0, 3.0, 52)
OPTIONS = TrainingOptions(
    preset="compact",
    range="5/0.5",
    output="/home/alice/runs",
    data=[
        "kitti-raw:/home/alice/KITTI/raw:2011_09_26/0048",
        "folder:/home/alice/rigs",
        "kitti-object:../object/:train",
    ],
    validate=["kitti-raw:/home/alice/KITTI/raw"],
    minutes=60.0,
    seed=3,
    initialize="/home/alice/weights/compact-10deg-1m.safetensors",
    scene_cache="/home/alice/scenes",
)


def training(recipe: Recipe = RECIPE, residuals: int = 0, **changes: Any) -> Training:
    options, network = replace(OPTIONS, **changes), tiny_network()
    recipe = recipe.of_run(options, network.config)
    frames = TrainingFrames([Source(Scenes(1), 1.0)], recipe, 64 * 128, options.batch, options.seed)
    draws = Draws(RANGES[2], recipe.draws, [miscalibration([1, 0, 0], [0, 0, 0])] * residuals, 0.4)
    stage = Stage(3, RANGES[2], network, StageSettings(1.4, 2, 1.5))
    samples = TrainingSamples(frames, draws, network.config.scales)
    fabric = Fabric(accelerator="cpu", devices=1)
    return Training(options, recipe, fabric, stage, samples, None, SHIPPED if options.initialize else "")


def record(recipe: Recipe = RECIPE) -> dict[str, Any]:
    made: dict[str, Any] = json.loads(json.dumps(training_record(training(recipe), 24_000, 60.04, FIGURES)))
    return made


def test_the_record_says_what_the_weights_come_from() -> None:
    made = record()
    assert (made["samples"], made["minutes"], made["device"]) == (24_000, 60.0, "cpu")
    assert made["validation"] == FIGURES._asdict()
    assert made["options"]["seed"] == 3 and made["options"]["range"] == "5/0.5"
    assert made["options"]["data"] == ["kitti-raw:raw:2011_09_26/0048", "folder:rigs", "kitti-object:object:train"]
    assert made["options"]["initialize"] == "compact-10deg-1m.safetensors"
    assert made["commit"] is None or re.fullmatch("[0-9a-f]{7,40}", made["commit"])
    assert made["licence_note"] == (
        f"Trained on frames of {Scenes.rig}, whose licences apply. Started from compact-10deg-1m.safetensors: {SHIPPED}"
    )


def test_the_licence_is_that_of_what_was_trained_on_and_of_nothing_else() -> None:
    anew = replace(training(initialize=None), inherited_licence="")
    assert licence_note(["robot"], anew) == "Trained on frames of robot, whose licences apply."
    assert licence_note([], anew) == "Trained on synthetic scenes."
    again = replace(training(), inherited_licence=licence_note(["robot"], training()))
    assert licence_note(["robot"], again) == again.inherited_licence, "a run that goes on with the same says no more"


def test_the_licence_of_weights_to_start_from_is_read_at_the_start(tmp_path: Path) -> None:
    network = tiny_network()
    for name, record in (("a", {"licence_note": "Ours alone."}), ("b", {})):
        save_network(tmp_path / name, network, network.state_dict(), record)
    assert inherited_licence(replace(OPTIONS, initialize=str(tmp_path / "a"))) == "Ours alone."
    assert "not recorded" in inherited_licence(replace(OPTIONS, initialize=str(tmp_path / "b")))
    assert inherited_licence(replace(OPTIONS, initialize=None)) == ""


def test_the_record_names_no_folder_of_the_machine() -> None:
    text = json.dumps(record()) + recipe_sentence(training(), 24_000)
    assert "alice" not in text and str(Path.home()) not in text and str(Path(__file__).parents[3]) not in text


def test_a_recipe_of_one_s_own_is_in_the_record() -> None:
    assert record()["recipe"] == {}
    own = replace(RECIPE, losses=replace(RECIPE.losses, quaternion=5.0))
    assert record(own)["recipe"] == {"losses.quaternion": 5.0}
    assert recipe_sentence(training(own), 8).endswith("; losses.quaternion 5.0")


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        (
            {"residuals": 2},
            "from compact-10deg-1m.safetensors, image branch frozen; 24,000 samples of kitti-raw:raw:2011_09_26/0048, "
            "folder:rigs, kitti-object:object:train, 40% synthetic scenes; 40% of the miscalibrations are what earlier "
            "looks leave",
        ),
        (
            {"train_image_branch": True, "synthetic": 0.0, "data": ["folder:rigs"]},
            "from compact-10deg-1m.safetensors, image branch trained; 24,000 samples of folder:rigs",
        ),
        (
            {"initialize": "/home/alice/runs/features/five.safetensors", "data": []},
            "from features/five.safetensors, image branch frozen; 24,000 samples of synthetic scenes",
        ),
        ({"initialize": None, "data": []}, "from random weights; 24,000 samples of synthetic scenes"),
    ],
)
def test_the_manifest_says_a_run_in_a_sentence(changes: dict[str, Any], expected: str) -> None:
    assert recipe_sentence(training(**changes), 24_000) == expected


def test_a_new_folder_s_manifest_has_the_settings_that_ship_but_not_the_runs(tmp_path: Path) -> None:
    shipped, weights = load_manifest("compact"), tmp_path / "runs" / "compact-5deg-0.5m.safetensors"
    made = manifest_with(training(), weights, 8, FIGURES)
    entries = {entry.range: entry for entry in made.stages}
    assert list(entries) == list(RANGES)
    mine = entries.pop(RANGES[2])
    assert (mine.file, mine.run, mine.validation) == (weights.name, "runs", FIGURES._asdict())
    assert mine.settings == StageSettings(1.4, 2, 1.5) and mine.recipe == recipe_sentence(training(), 8)
    for range_, entry in entries.items():
        assert entry == StageEntry(range_, shipped.file(range_), shipped.settings(range_))
    assert made.match_error_limit_px == shipped.match_error_limit_px


def test_what_another_run_wrote_meanwhile_stays(tmp_path: Path) -> None:
    other = StageEntry(MiscalibrationRange(2, 0.2), "two.safetensors", StageSettings(2.0), "7", "from nothing")
    Manifest("compact", stages=(other,)).write(manifest_path("compact", tmp_path))
    made = manifest_with(training(), tmp_path / "five.safetensors", 8, None)
    assert [entry.file for entry in made.stages] == ["five.safetensors", "two.safetensors"]
    assert made.stages[1] == other
