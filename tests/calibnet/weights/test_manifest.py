"""The manifest of a set of weights says what acts, and says it of the files that are there."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from calibnet.cascade import Cascade
from calibnet.errors import WeightsError
from calibnet.geometry import RANGES, MiscalibrationRange
from calibnet.weights import save_network, weights_path
from calibnet.weights.files import read_header
from calibnet.weights.manifest import PACKAGE, Manifest, StageEntry, StageSettings, load_manifest, manifest_path
from tests.support.tiny import tiny_network

SHIPPED = load_manifest("compact")


def test_the_shipped_manifest_lists_the_files_that_ship() -> None:
    assert [entry.range for entry in SHIPPED.stages] == list(RANGES)
    assert {entry.file for entry in SHIPPED.stages} == {path.name for path in PACKAGE.glob("compact-*.safetensors")}


@pytest.mark.parametrize("entry", SHIPPED.stages, ids=lambda entry: str(entry.range))
def test_it_says_of_each_file_what_its_header_says(entry: StageEntry) -> None:
    header = read_header(PACKAGE / entry.file)
    assert MiscalibrationRange.parse(header.range) == entry.range
    assert entry.validation.keys() == header.record["validation"].keys()
    for key, value in header.record["validation"].items():
        assert entry.validation[key] == pytest.approx(value, abs=5e-4), key


def test_what_it_says_is_what_acts(tmp_path: Path) -> None:
    network = tiny_network(stage=5)
    save_network(tmp_path / "mine.safetensors", network, network.state_dict(), {})
    entry = StageEntry(RANGES[4], "mine.safetensors", StageSettings(image_size=1.5, looks=3, gain=1.2))
    written = replace(SHIPPED, match_error_limit_px=7.0, common_translation_m=0.02, stages=(entry,))
    written.write(manifest_path("compact", tmp_path))
    cascade = Cascade.load("compact", (4, 5), tmp_path)
    (stage,) = cascade.stages
    assert (stage.number, stage.settings, stage.match_error_limit_px) == (5, entry.settings, 7.0)
    assert [skipped.number for skipped in cascade.skipped] == [4]
    np.testing.assert_allclose(np.diag(cascade.common_error), [4e-4] * 3 + [np.radians(0.12) ** 2] * 3, rtol=1e-12)


def test_only_the_finest_stage_judges() -> None:
    stages = Cascade.load("compact", (4, 5)).stages
    assert [stage.match_error_limit_px for stage in stages] == [math.inf, SHIPPED.match_error_limit_px]


def test_a_manifest_comes_back_as_it_was_written(tmp_path: Path) -> None:
    path = tmp_path / "compact.toml"
    for manifest in (SHIPPED, Manifest("compact", match_error_limit_px=math.inf)):
        manifest.write(path)
        assert load_manifest("compact", tmp_path) == manifest


def test_a_folder_without_one_is_used_as_the_shipped_weights_are(tmp_path: Path) -> None:
    assert load_manifest("compact", tmp_path) == SHIPPED
    assert load_manifest("paper", tmp_path) == Manifest("paper")
    assert Manifest("paper").settings(RANGES[0]) == StageSettings(1.0, 1, 1.0)
    assert weights_path("paper", RANGES[1], tmp_path) == tmp_path / "paper-10deg-1m.safetensors"


def test_a_stage_trained_anew_takes_the_place_of_the_old_one() -> None:
    entry = StageEntry(RANGES[2], "new.safetensors", run="99")
    changed = SHIPPED.with_stage(entry)
    assert [stage.range for stage in changed.stages] == list(RANGES) and changed.stages[2] == entry
    assert changed.stages[:2] + changed.stages[3:] == SHIPPED.stages[:2] + SHIPPED.stages[3:]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("preset = ", "not a manifest"),
        ('preset = "paper"', "of preset 'paper', not of compact"),
        ('preset = "compact"\nlimit = 3', "limit"),
        ('preset = "compact"\n[[stages]]\nfile = "x"', "range"),
        (
            'preset = "compact"\n[[stages]]\nrange = "5/0.5"\nfile = "x"\nlooks = 0',
            "stages.0.looks: input should",
        ),
        ('preset = "compact"\n[[stages]]\nrange = "wide"\nfile = "x"', "wide"),
        ("", "preset"),
    ],
)
def test_a_malformed_manifest_is_one_sentence(tmp_path: Path, text: str, said: str) -> None:
    manifest_path("compact", tmp_path).write_text(text)
    with pytest.raises(WeightsError, match=said) as raised:
        load_manifest("compact", tmp_path)
    assert "compact.toml" in str(raised.value) and "\n" not in str(raised.value)
