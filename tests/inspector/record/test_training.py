"""The recording of a training: every curve has a name that the legends have too, and the figures come back."""

from __future__ import annotations

import math
from pathlib import Path

from rerun.chunk import RrdReader

from calibnet.training.progress import Progress
from calibnet.training.validation import ValidationFigures
from inspector.record.training import HELD_OUT, ON_TRAINING, TrainingLog, training_blueprint
from tests.support.layout import views

LOSSES = {"matching": 0.5, "pose": 0.25, "rotation_deg": 0.4, "translation_cm": 7.0}


def recorded(file: Path) -> dict[str, list[object]]:
    """Values of every component of every entity, in their order."""
    found: dict[str, list[object]] = {}
    for chunk in RrdReader(file).stream():
        for name, values in chunk.to_record_batch().to_pydict().items():
            found.setdefault(f"{chunk.entity_path} {name}", []).extend(values)
    return found


def test_curves_have_names_and_values(tmp_path: Path) -> None:
    file = tmp_path / "training.rrd"
    with TrainingLog(file, "stage 5") as log:
        log.progressed(Progress(640, 0.5, 0.1, 20.0, LOSSES | {"pose": math.nan}))
        second = Progress(1280, 1.0, 0.2, 20.0, LOSSES)
        log.progressed(second)
        log.validated(second, ValidationFigures(1.0, 17.0, 0.5, 8.0, 1.2, 40))
    found = recorded(file)
    assert found["/training/matching Scalars:scalars"] == [[0.5], [0.5]]
    assert found["/training/pose Scalars:scalars"] == [[0.25]]  # the warm-up has none
    assert found["/validation/rotation_p95_deg Scalars:scalars"] == [[1.2]]
    assert found["/training/matching SeriesLines:names"] == [["matching"]]
    assert found["/training/rotation_deg SeriesLines:names"] == [[ON_TRAINING[0]]]
    assert found["/validation/translation_cm SeriesLines:names"] == [[HELD_OUT["{}"][0]]]
    assert found["/validation/initial_translation_cm SeriesLines:names"] == [[HELD_OUT["initial_{}"][0]]]
    shown = {str(path).lstrip("$") for view in views(training_blueprint().root_container) for path in view.contents}
    assert {"/training/rotation_deg", "/validation/rotation_p95_deg", "/validation/translation_cm"} <= shown
    assert "- /training/translation_cm" in shown  # a figure, no term of the loss
