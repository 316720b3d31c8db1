"""``calib-inspect fit-verdict``: from a folder of weights to its coefficients."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path

import pytest
from click.testing import CliRunner

from calibnet.evaluation import verdict_log
from calibnet.evaluation.verdict_runs import VerdictRun
from calibnet.geometry import RANGES
from calibnet.judging.coefficients import load_coefficients
from calibnet.judging.covariance import CovarianceModel
from calibnet.judging.drive_predictors import DrivePredictors
from calibnet.weights.manifest import load_manifest
from inspector.cli.errors import run
from inspector.cli.main import cli
from tests.calibnet.evaluation.test_lens_fit import OF_DRIVES, SHOWS_IN_DRIVES, lens_runs
from tests.calibnet.evaluation.test_verdict_fit import runs


class Known:
    """A stream of runs that are there already."""

    made = 0

    def __init__(self, kind: verdict_log.Kind) -> None:
        self.kind = kind
        if kind == "lenses":
            self.runs = lens_runs(120, 6.0)
        elif kind == "drive-lenses":
            self.runs = lens_runs(120, 6.0, 1, OF_DRIVES, SHOWS_IN_DRIVES)
        else:
            self.runs = runs(300, CovarianceModel(), seed=1)

    def run(self, number: int) -> VerdictRun:
        Known.made += 1
        made = self.runs[number]
        if self.kind != "drives":
            return made
        assert made.predictors is not None
        said = {one.name: 0.0 for one in fields(DrivePredictors)} | {"match_error": made.predictors["match_error"]}
        return replace(made, predictors=said, match_error_px=float("nan"))


@pytest.fixture
def weights(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Files that stand for the stages' weights, and runs in no time."""
    for stage in load_manifest("compact").stages:
        (tmp_path / stage.file).write_bytes(stage.file.encode())
    monkeypatch.setattr(verdict_log.Source, "open", lambda source: Known(source.kind))
    return tmp_path


def test_coefficients_come_to_lie_beside_the_weights_and_belong_to_them(weights: Path) -> None:
    arguments = ["fit-verdict", "--weights", str(weights), "--runs", "300", "--lenses", "120", "--workers", "0"]
    Known.made = 0
    result = CliRunner().invoke(cli, arguments, catch_exceptions=False)
    assert result.exit_code == 0 and result.stdout.strip() == str(weights / "compact-verdict.toml")
    assert "300 runs of frames on 7 sequences.\n150 of them have no fault" in result.stderr
    coefficients = load_coefficients(load_manifest("compact", weights), weights)
    assert coefficients.missing == "" and coefficients.fitted["seed"] == 0
    assert set(coefficients.weights) == set(RANGES[2:])
    assert coefficients.fitted["frames"]["false_accept_rate"] == pytest.approx(1 / 300)  # at most 0.5 %
    assert coefficients.drive is not None and coefficients.drive.weights["match_error"] > 1
    assert coefficients.lens is not None and coefficients.fitted["lenses"]["runs"] == 120
    assert coefficients.drive_lens is not None and coefficients.fitted["drive-lenses"]["runs"] == 120
    assert set(coefficients.drive_lens.weights["focal-length"]) == set(OF_DRIVES)
    assert "120 runs on 5 sequences, 60 of them with a fault of the lens." in result.stderr
    assert "80 runs of drives on 7 sequences." in result.stderr
    before = (weights / "compact-verdict.toml").read_bytes()
    assert CliRunner().invoke(cli, arguments, catch_exceptions=False).exit_code == 0
    assert Known.made == 300 + 120 + 80 + 120 and (weights / "compact-verdict.toml").read_bytes() == before
    (weights / load_manifest("compact").file(RANGES[4])).write_bytes(b"trained on")
    assert load_coefficients(load_manifest("compact", weights), weights).frame is None


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--synthetic-drives", "0"], "There are no drives; give --data, or --synthetic-drives above 0."),
        (["--data", "folder:/nowhere"], "Folder /nowhere of 'folder:/nowhere' does not exist; check the path."),
        (["--runs", "4"], "Make more runs, or add other data."),
    ],
)
def test_what_cannot_be_done_is_a_sentence(
    weights: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], said: str
) -> None:
    assert run(cli, ["fit-verdict", "--weights", str(weights), "--workers", "0", *arguments]) == 3
    assert said in capsys.readouterr().err and not (weights / "compact-verdict.toml").exists()
