from __future__ import annotations

import json
import re
from pathlib import Path

from calibnet.training.options import TrainingOptions
from calibnet.training.record import training_record
from calibnet.training.validation import ValidationFigures

FIGURES = ValidationFigures(4.7, 48.0, 1.2, 20.0, 3.0, 52)


def record(**changes: object) -> dict[str, object]:
    options = TrainingOptions(
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
    return training_record(options, 24_000, 60.04, "cpu", FIGURES) | changes


def test_the_record_says_what_the_weights_come_from() -> None:
    made = json.loads(json.dumps(record()))
    assert (made["samples"], made["minutes"], made["device"]) == (24_000, 60.0, "cpu")
    assert made["validation"] == FIGURES._asdict()
    assert made["options"]["seed"] == 3 and made["options"]["range"] == "5/0.5"
    assert made["options"]["data"] == ["kitti-raw:raw:2011_09_26/0048", "folder:rigs", "kitti-object:object:train"]
    assert made["options"]["initialize"] == "compact-10deg-1m.safetensors"
    assert made["commit"] is None or re.fullmatch("[0-9a-f]{7,40}", made["commit"])
    assert "KITTI" in made["licence_note"]


def test_the_record_names_no_folder_of_the_machine() -> None:
    text = json.dumps(record())
    assert "alice" not in text and str(Path.home()) not in text and str(Path(__file__).parents[3]) not in text
