"""``calib-inspect live`` from its options to its end."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import urllib.request
from pathlib import Path

import pytest

from inspector.cli.errors import run
from inspector.cli.main import cli


def test_it_serves_until_it_is_ended(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "inspector", "live", "demo", "--length", "1", "--no-open", "--stages", "5"]
    process = subprocess.Popen(
        [*command, "--output", str(tmp_path / "found.yaml")], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        assert process.stdout is not None
        address = re.search(r"http://127\.0\.0\.1:\d+/[\w-]{20,}/", process.stdout.readline())
        assert address is not None
        with urllib.request.urlopen(address[0], timeout=30) as page:
            assert b"calib-inspect live" in page.read()
        with urllib.request.urlopen(f"{address[0]}viewer/re_viewer.js", timeout=30) as script:
            assert b"WebHandle" in script.read()
        process.send_signal(signal.SIGTERM)
        _, errors = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode == 0
    assert "Traceback" not in errors and not (tmp_path / "found.yaml").exists()


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["demo", "--output", "{mine}"], 3, "is not a file that calib-inspect exported"),
        (["demo", "--range", "5/0.5", "--miscalibrate", "1,1,1,0,0,0"], 2, "not both"),
        (["demo", "--connect", "rerun+http://127.0.0.1:1/proxy"], 2, "--connect needs --native"),
        (["demo", "--native", "--connect", "rerun+http://127.0.0.1:1/proxy"], 3, "No viewer listens"),
        (["demo", "--native", "--connect", "nonsense"], 3, "is not a valid address"),
        (["demo", "--fix", "up"], 2, "'up'"),
        (["seq", "04"], 3, "No KITTI folder"),
        (["folder", "{empty}"], 3, "calibration"),
        (["bag", "{mine}"], 3, "mine.yaml"),
    ],
)
def test_what_cannot_be_is_a_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], code: int, words: str
) -> None:
    mine, empty = tmp_path / "mine.yaml", tmp_path / "empty"
    mine.write_text("a: 1\n")
    empty.mkdir()
    given = [argument.format(mine=mine, empty=empty) for argument in arguments]
    assert run(cli, ["live", *given]) == code
    assert words in capsys.readouterr().err
    assert mine.read_text() == "a: 1\n"
