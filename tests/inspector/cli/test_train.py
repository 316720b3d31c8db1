from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner

from calibnet.geometry import MiscalibrationRange
from calibnet.training.options import TrainingOptions
from calibnet.weights import weights_path
from inspector.cli import train as command
from inspector.cli.main import cli


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
