from __future__ import annotations

import json
from pathlib import Path

import pytest

from calibnet.geometry import RANGES
from calibnet.network.config import load_preset
from calibnet.network.network import CalibrationNetwork
from inspector.cli.errors import run
from inspector.cli.main import cli


def test_json_on_stdout_adds_up_and_counts_every_parameter(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(cli, ["info", "--preset", "compact", "--json", "-"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert content["parameters"] == sum(module["parameters"] for module in content["modules"])
    assert content["multiply_adds"] == sum(module["multiply_adds"] for module in content["modules"])
    network = CalibrationNetwork(load_preset("compact"), RANGES[2])
    assert content["parameters"] == sum(parameter.numel() for parameter in network.parameters())
    assert all(set(module) == {"name", "parameters", "multiply_adds"} for module in content["modules"])


def test_table_and_file_say_the_same(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "info.json"
    assert run(cli, ["info", "--preset", "compact", "--json", str(out)]) == 0
    content = json.loads(out.read_text())
    printed = capsys.readouterr().out
    assert f"{content['parameters'] / 1e6:.3f} M" in printed
    assert f"{content['multiply_adds'] / 1e9:.3f} G" in printed
    assert all(module["name"] in printed for module in content["modules"])


def test_an_unknown_preset_is_one_sentence(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(cli, ["info", "--preset", "huge"]) == 3
    assert "'huge'" in capsys.readouterr().err
