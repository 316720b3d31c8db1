"""``ablate`` from its options to table, JSON and Markdown; ``train`` with what does not go together."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from calibnet.geometry import RANGES
from calibnet.network.config import load_preset
from calibnet.network.network import CalibrationNetwork
from calibnet.training.ablations import ABLATIONS
from inspector.cli.errors import run
from inspector.cli.main import cli


def test_costs_need_no_frames_and_come_back_from_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, page = tmp_path / "table-3.json", tmp_path / "table-3.md"
    assert run(cli, ["ablate", "--preset", "compact", "--json", str(out)]) == 0
    content = json.loads(out.read_text())
    rows = {row["name"]: row for row in content["rows"]}
    assert list(rows) == list(ABLATIONS)
    network = CalibrationNetwork(load_preset("compact"), RANGES[2])
    assert rows["full"]["parameters"] == sum(parameter.numel() for parameter in network.parameters())
    assert rows["full"]["preset"] == "compact"
    assert rows["full"]["latency_ms"] is None
    said = " ".join(capsys.readouterr().out.split())
    assert said.count("Rows without errors, since they are not trained: compact (all rows). ") == 1
    assert "train --preset PRESET --ablation ROW --range 5/0.5" in said
    assert run(cli, ["ablate", "--from", str(out), "--markdown", str(page)]) == 0
    written = page.read_text()
    assert "## compact" in written and "| without | parameters | multiply-adds | the paper |\n" in written
    assert "| – (full) | 2.65 M (20.5) | 3.14 G (78.3) | 0.068° / 0.864 cm |" in written


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (["ablate", "--range", "4/0.4"], 2, "20/1.5, 10/1, 5/0.5, 2/0.2, 1/0.1"),
        (["ablate", "--preset", "huge"], 3, "'huge'"),
        (["ablate", "--from", "cut.json"], 3, "rows is missing"),
        (["ablate", "--from", "other.json"], 3, "was not written by `calib-inspect ablate --json`"),
        (["train", "--method", "lccnet", "--range", "4/0.4", "--samples", "8"], 2, "20/1.5, 10/1, 5/0.5, 2/0.2, 1/0.1"),
        (["train", "--method", "lccnet", "--all", "--samples", "8"], 2, "--method trains one network"),
        (["train", "--method", "lccnet", "--ablation", "full", "--range", "5/0.5", "--samples", "8"], 2, "--method"),
        (["train", "--ablation", "full", "--all", "--samples", "8"], 2, "--ablation trains one stage"),
    ],
)
def test_what_does_not_go_is_a_sentence(
    arguments: list[str],
    code: int,
    said: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("other.json").write_text("{}")
    cut = {"table": "ablate", "range": "5/0.5", "input": [256, 512], "processor": "x", "sequences": []}
    Path("cut.json").write_text(json.dumps(cut | {"repeats": 1, "seed": 0, "threads": 1}))
    assert run(cli, arguments) == code
    assert said in " ".join(capsys.readouterr().err.split())
