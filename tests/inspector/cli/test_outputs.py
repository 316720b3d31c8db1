"""The outputs of one command are of one run: while another run has one of them, none is written."""

from __future__ import annotations

from pathlib import Path

import pytest

from calibnet.runtime.claim import locked
from inspector.cli.errors import run
from inspector.cli.main import cli


def test_all_outputs_of_a_command_are_of_one_run(
    full_recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    json_file, junit = tmp_path / "verdict.json", tmp_path / "junit.xml"
    command = ["check", str(full_recording), "--json", str(json_file), "--junit", str(junit)]
    json_file.write_text('{"verdict": "of the other run"}')
    with locked(junit):
        assert run(cli, command) == 3
    assert "junit.xml is being written by another run; choose another name" in capsys.readouterr().err
    assert json_file.read_text() == '{"verdict": "of the other run"}'
    assert run(cli, command) in (0, 1, 4)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["junit.xml", "verdict.json"]
    with locked(junit), locked(json_file):  # the command has let go of both
        pass


def test_a_folder_that_cannot_be_written_fails_before_the_work(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").touch()
    assert run(cli, ["info", "--json", str(tmp_path / "file" / "info.json")]) == 3
    assert "info.json cannot be written" in capsys.readouterr().err


def test_an_output_may_have_a_name_as_long_as_any(tmp_path: Path) -> None:
    file = tmp_path / f"{'n' * 250}.json"
    assert run(cli, ["info", "--json", str(file)]) == 0
    assert list(tmp_path.iterdir()) == [file]
