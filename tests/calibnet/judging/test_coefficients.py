"""Coefficients of the verdict, bound to the weights they were fitted to."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from calibnet.errors import WeightsError
from calibnet.geometry import RANGES
from calibnet.judging.classifier import Classifier
from calibnet.judging.coefficients import Coefficients, coefficients_path, load_coefficients
from calibnet.judging.covariance import CovarianceModel
from calibnet.judging.lens_causes import FAULTS, LensOdds
from calibnet.weights.fingerprint import fingerprints
from calibnet.weights.manifest import PACKAGE, Manifest, StageEntry, StageSettings, load_manifest

MANIFEST = Manifest("mine", stages=(StageEntry(RANGES[3], "four"), StageEntry(RANGES[4], "five")))
COARSER = Classifier(-2.5, {"match_error": 1.0}, 0.25, 0.75)
CLASSIFIER = Classifier(-1.5, {"match_error": 2.0, "misfit": 0.25}, 0.25, 0.75, COARSER)
DRIVE = Classifier(0.5, {"aligned": 1.5}, 0.1, 0.9, Classifier(0.25, {"aligned": 1.0}, 0.2, 0.9))
LENS = LensOdds(0.7, dict.fromkeys(FAULTS, -1.0), {name: {"fine_focal_gain": 2.5} for name in FAULTS})

DRIVE_LENS = LensOdds(0.8, dict.fromkeys(FAULTS, -2.0), {name: {"focal_gain": 1.5} for name in FAULTS})


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "four").write_bytes(b"of stage 4")
    (tmp_path / "five").write_bytes(b"of stage 5")
    MANIFEST.write(tmp_path / "mine.toml")
    marks = fingerprints("mine", tmp_path, [RANGES[3], RANGES[4]])
    whole = Coefficients(
        CLASSIFIER, CovarianceModel(0.1, 0.05, 0.3), LENS, DRIVE, DRIVE_LENS, 1.25, marks, "", {"runs": 90}
    )
    whole.write(coefficients_path("mine", tmp_path))
    return tmp_path


def test_they_are_read_as_they_were_written(folder: Path) -> None:
    coefficients = load_coefficients(MANIFEST, folder)
    assert coefficients.for_frame(RANGES[4]) == CLASSIFIER and coefficients.missing == ""
    assert coefficients.covariance == CovarianceModel(0.1, 0.05, 0.3) and coefficients.fitted == {"runs": 90}
    assert coefficients.for_drive(RANGES[4]) == DRIVE and coefficients.inflation == 1.25
    assert coefficients.lens == LENS and coefficients.drive_lens == DRIVE_LENS
    without = replace(coefficients, drive=None).for_drive(RANGES[4])
    assert without == "The verdict on drives has not been fitted."
    other = coefficients.for_frame(RANGES[3])
    assert isinstance(other, str) and "end with the stage of ±1°/0.1 m" in other


def test_weights_that_were_trained_on_or_are_used_otherwise_have_none(folder: Path) -> None:
    used = replace(MANIFEST.stages[1], settings=StageSettings(gain=1.5))
    for manifest in (MANIFEST.with_stage(used), MANIFEST):
        (folder / "five").write_bytes(b"of stage 5" if manifest is not MANIFEST else b"trained on")
        coefficients = load_coefficients(manifest, folder)
        assert coefficients.frame is None and coefficients.for_frame(RANGES[4]) == coefficients.missing
        assert "have changed: ±1°/0.1 m; `calib-inspect fit-verdict --weights" in coefficients.missing


def test_own_weights_without_any_are_told_how_to_get_them_and_a_copy_needs_none(tmp_path: Path) -> None:
    manifest = load_manifest("compact")
    empty = load_coefficients(manifest, tmp_path)
    assert empty.frame is None
    assert empty.missing == (
        f"The verdict has not been fitted to the weights in {tmp_path}; "
        f"`calib-inspect fit-verdict --weights {tmp_path} --data …` fits it."
    )
    for stage in manifest.stages:
        shutil.copy(PACKAGE / stage.file, tmp_path)
    assert load_coefficients(manifest, tmp_path) == load_coefficients(manifest)
    (tmp_path / manifest.file(RANGES[4])).write_bytes(b"trained on")
    assert load_coefficients(manifest, tmp_path).frame is None


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("match_error", "matcherror", "there is no predictor matcherror"),
        ("[covariance]", "[sprawl]", "covariance is missing"),
        ("intercept = -1.5", 'intercept = "x"', "frame.intercept: input should be a valid number"),
        ("intercept = 0.5", 'intercept = "x"', "drive.intercept: input should be a valid number"),
        ("inflation = 1.25", "inflation = []", "drive.inflation: input should be a valid number"),
        ("match_error = 2.0", "match_error = true", "frame.weights.match_error: input should be a valid number"),
        ('"2/0.2" = ', '"two" = ', "Range 'two' is not of the form"),
        ("[fitted]", "[[fitted]]", "fitted: input should be a"),
        ("fine_focal_gain", "fine_focal_loss", "there is no predictor fine_focal_loss"),
        ("distortion = -1.0", "astigmatism = -1.0", "faults of the lens are focal-length, principal-point, distortion"),
    ],
)
def test_a_malformed_file_is_a_sentence(folder: Path, old: str, new: str, said: str) -> None:
    path = coefficients_path("mine", folder)
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(WeightsError, match=said):
        load_coefficients(MANIFEST, folder)


def test_a_stage_without_weights_has_no_fingerprint(folder: Path) -> None:
    (folder / "four").unlink()
    with pytest.raises(WeightsError, match=r"There are no weights of ±2°/0\.2 m in"):
        fingerprints("mine", folder, [RANGES[3], RANGES[4]])
