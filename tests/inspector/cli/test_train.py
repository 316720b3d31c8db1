from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
import torch
from click.testing import CliRunner

from calibnet.cascade import Cascade
from calibnet.geometry import RANGES, MiscalibrationRange, miscalibration
from calibnet.training import build
from calibnet.training.data import Source
from calibnet.training.options import TrainingOptions
from calibnet.training.recipe import RECIPE
from calibnet.weights import weights_path
from calibnet.weights.manifest import load_manifest
from inspector.cli import train as command
from inspector.cli.main import cli
from tests.support.scene import Scenes, make_frame
from tests.support.tiny import TINY


@pytest.fixture
def trained(monkeypatch: pytest.MonkeyPatch) -> list[tuple[TrainingOptions, Path | None]]:
    """What was trained and where it was recorded; weights appear without the hours."""
    calls: list[tuple[TrainingOptions, Path | None]] = []

    def train_stage(options: TrainingOptions, console: object, save: Path | None, resume: bool) -> None:
        calls.append((options, save))
        path = weights_path(options.preset, MiscalibrationRange.parse(options.range), Path(options.output))
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()

    monkeypatch.setattr(command, "train_stage", train_stage)
    return calls


def test_all_records_every_step_in_a_file_of_its_own(
    tmp_path: Path, trained: list[tuple[TrainingOptions, Path | None]]
) -> None:
    arguments = ["train", "--all", "--minutes", "6", "--output", str(tmp_path / "runs"), "--save", "log.rrd"]
    result = CliRunner().invoke(cli, arguments, catch_exceptions=False)
    assert result.exit_code == 0
    assert [str(save) for _, save in trained] == [
        "log-features-5-0.5.rrd",
        "log-20-1.5.rrd",
        "log-10-1.rrd",
        "log-5-0.5.rrd",
        "log-2-0.2.rrd",
        "log-1-0.1.rrd",
    ]
    again = CliRunner().invoke(cli, arguments, catch_exceptions=False)
    assert again.exit_code == 0 and len(trained) == 6 and "have their weights" in again.stderr


def test_one_stage_is_recorded_where_it_is_told(
    tmp_path: Path, trained: list[tuple[TrainingOptions, Path | None]]
) -> None:
    arguments = ["train", "--range", "5/0.5", "--samples", "8", "--output", str(tmp_path), "--save", "log.rrd"]
    assert CliRunner().invoke(cli, arguments, catch_exceptions=False).exit_code == 0
    ((options, save),) = trained
    assert (options.range, options.output, str(save)) == ("5/0.5", str(tmp_path), "log.rrd")


def test_all_stages_end_in_a_folder_that_a_cascade_runs_from(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "runs"
    sources = [Source(Scenes(2), 1.0)]
    monkeypatch.setattr(build, "load_preset", lambda name: TINY)
    monkeypatch.setattr(build, "training_sources", lambda options: (sources, [Scenes(1)]))
    monkeypatch.setattr(command, "RECIPE", replace(RECIPE, draws=replace(RECIPE.draws, residuals=4)))
    torch.set_num_threads(1)
    arguments = ["train", "--all", "--samples", "12", "--batch", "2", "--workers", "0", "--output", str(folder)]
    arguments += ["--data", f"folder:{tmp_path}/rigs"]
    result = CliRunner().invoke(cli, arguments, catch_exceptions=False)
    assert result.exit_code == 0, result.stderr

    manifest, shipped = load_manifest("compact", folder), load_manifest("compact")
    assert [entry.range for entry in manifest.stages] == list(RANGES)
    for entry in manifest.stages:
        assert (folder / entry.file).is_file() and entry.run == "runs" and entry.validation["samples"] == 4
        assert entry.settings == shipped.settings(entry.range), "used as the stages that ship are"
        assert entry.recipe.startswith(("from compact-", "from features/compact-5deg"))
        assert "samples of folder:rigs, 40% synthetic" in entry.recipe
    assert "70% of the miscalibrations are what earlier looks leave" in manifest.stages[1].recipe
    (first,) = (entry for entry in load_manifest("compact", folder / "features").stages if entry.run)
    assert (first.run, first.range) == ("features", RANGES[2]) and first.recipe.startswith("from random weights")

    cascade = Cascade.load("compact", folder=folder)
    assert [stage.number for stage in cascade.stages] == [1, 2, 3, 4, 5] and not cascade.skipped
    frame = make_frame(7)
    trace = cascade.calibrate(frame, miscalibration([1, 0, 0], [0, 0, 0]) @ frame.camera_from_lidar)
    assert [stage.number for stage in trace.stages] == [1, 2, 3, 4, 5]
