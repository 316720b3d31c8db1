"""``bench``: a table of all methods, of which each row that cannot be measured says why."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import pytest

from calibnet.methods.registry import METHODS
from inspector.cli.errors import run
from inspector.cli.main import cli
from inspector.report.bench_tables import as_markdown
from tests.inspector.cli.test_methods import Boaster, Hungry, Mover
from tests.inspector.cli.test_plugins import start
from tests.support.folder import write_folder
from tests.support.toy_package import install_toys


@pytest.fixture
def measured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> dict[str, Any]:
    """What ``bench`` says of three methods of the tests on three frames, and what it prints."""
    for name, kind in {"boaster": Boaster, "mover": Mover, "hungry": Hungry}.items():
        monkeypatch.setitem(METHODS.own, name, f"{kind.__module__}:{kind.__name__}")
    folder = write_folder(tmp_path / "own", 3)
    (tmp_path / "table.partial.json").write_text("a user's")
    files = {kind: str(tmp_path / f"table.{kind}") for kind in ("json", "csv", "html", "markdown")}
    options = [word for kind, file in files.items() for word in (f"--{kind}", file)]
    code = run(
        cli,
        [
            "bench",
            "--method",
            "boaster",
            "--method",
            "mover",
            "--method",
            "hungry",
            "--data",
            f"folder:{folder}",
            "--range",
            "5/0.5",
            *options,
        ],
    )
    out, err = capsys.readouterr()
    assert code == 0, err
    assert "Replaced" not in err and (tmp_path / "table.partial.json").read_text() == "a user's"
    return {"out": out, "err": err, **{kind: Path(file).read_text() for kind, file in files.items()}}


def test_every_method_has_its_rows_and_what_cannot_run_says_why(measured: dict[str, Any]) -> None:
    content = json.loads(measured["json"])
    methods = content["methods"]
    assert list(methods) == ["boaster", "mover", "hungry"]
    boaster, mover = (methods[name]["rows"][0] for name in ("boaster", "mover"))
    assert (boaster["of"], boaster["runs"], boaster["refused"], boaster["in_rig"]) == ("frames", 3, 0, False)
    assert boaster["rotation_deg"]["p95"] < 1e-4 and boaster["success_2deg_5cm"] == 1.0
    assert (mover["of"], mover["runs"]) == ("drives", 1) and mover["translation_cm"]["median"] < 1e-4
    (hungry,) = methods["hungry"]["rows"]
    assert hungry["why"].startswith("There are no weights of hungry") and "rotation_deg" not in hungry
    assert "hungry, 5/0.5: There are no weights of hungry" in measured["err"]
    assert methods["boaster"]["audit"]["grey"]["rotation_deg"]["median"] < 1e-4  # it does not look
    assert methods["boaster"]["parameters"] == 0 and methods["boaster"]["latency_ms"] > 0


def test_all_forms_of_the_table_have_the_same_rows(measured: dict[str, Any]) -> None:
    lines = list(csv.DictReader(measured["csv"].splitlines()))
    assert [(line["method"], line["of"], line["runs"]) for line in lines] == [
        ("boaster", "frames", "3"),
        ("mover", "drives", "1"),
        ("hungry", "–", ""),
    ]
    assert measured["markdown"] == as_markdown(json.loads(measured["json"]))
    assert "| boaster | test rig" not in measured["markdown"] and "| boaster |" in measured["markdown"]
    assert "There are no weights of hungry" in measured["html"] and "<th>mover</th>" in measured["html"]
    assert "boaster" in measured["out"] and "0 of 3" in measured["out"]


def test_an_earlier_table_is_shown_without_measuring(
    measured: dict[str, Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = tmp_path / "again.html"
    assert run(cli, ["bench", "--from", str(tmp_path / "table.json"), "--html", str(page)]) == 0
    assert page.read_text() == measured["html"]
    capsys.readouterr()
    other = tmp_path / "other.json"
    other.write_text("{}")
    assert run(cli, ["bench", "--from", str(other)]) == 3
    assert "was not written by `calib-inspect bench --json`" in capsys.readouterr().err
    content = json.loads(measured["json"])
    del content["methods"]["mover"]["parameters"]
    content["ranges"] = 5
    other.write_text(json.dumps(content))
    assert run(cli, ["bench", "--from", str(other)]) == 3
    said = " ".join(capsys.readouterr().err.split())
    assert "ranges: input should be a valid array, methods.mover.parameters is missing" in said


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ((), "--data is needed"),
        (("--method", "nosuch", "--data", "folder:."), "'nosuch' is not a method"),
        (("--ours", "mine", "--data", "folder:."), "is not of the form NAME=DIR"),
        (("--data", "nothing"), "is not of the form DATASET:FOLDER"),
    ],
)
def test_wrong_use_is_a_sentence(arguments: tuple[str, ...], sentence: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(cli, ["bench", *arguments]) in (2, 3)
    assert sentence in " ".join(capsys.readouterr().err.split())


def test_a_method_of_another_package_is_a_row(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install_toys(tmp_path, monkeypatch)
    folder = write_folder(tmp_path / "own", 2)
    done = start(
        tmp_path,
        "bench",
        "--method",
        "nothing",
        "--method",
        "broken",
        "--data",
        f"folder:{folder}",
        "--no-audit",
        "--json",
        "-",
    )
    assert done.returncode == 0, done.stderr
    methods = json.loads(done.stdout)["methods"]
    assert [row["runs"] for row in methods["nothing"]["rows"]] == [2, 2]
    assert "of package broken_package cannot be imported" in methods["broken"]["rows"][0]["why"]
