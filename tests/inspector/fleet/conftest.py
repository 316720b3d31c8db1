"""A small fleet of the fake car's drives, and the command on it without an engine."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from inspector.cli.errors import run
from inspector.cli.main import cli
from inspector.fleet.table import TABLE, Row, read_table
from tests.support.folder import write_folder
from tests.support.judged_drives import JudgedCascade

Invoke = Callable[..., tuple[int, str, str]]


@pytest.fixture
def cascade(monkeypatch: pytest.MonkeyPatch) -> JudgedCascade:
    """What every command in this process calibrates with."""
    from calibnet.cascade import cascade as module

    fake = JudgedCascade(stages=(5,), strides=(32,))  # what a fleet does with a drive does not depend on either
    monkeypatch.setattr(module.Cascade, "load", staticmethod(lambda *_, **__: fake))
    return fake


@pytest.fixture
def invoke(
    cascade: JudgedCascade, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> Invoke:
    """Call `calib-inspect`; returns the exit code and what it printed."""
    monkeypatch.chdir(tmp_path)
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "KITTI_ROOT"):
        monkeypatch.delenv(name, raising=False)

    def call(*arguments: str) -> tuple[int, str, str]:
        code = run(cli, list(arguments))
        out, err = capsys.readouterr()
        return code, out, err

    return call


@pytest.fixture
def cars(tmp_path: Path) -> Path:
    """Two drives of one car, each with two frames."""
    for drive in ("monday", "tuesday"):
        write_folder(tmp_path / "car-a" / drive, 2)
    return tmp_path / "car-a"


def rows_of(folder: Path) -> dict[str, Row]:
    """The rows of a fleet's table by the drive's name."""
    return {row.drive: row for row in read_table(folder / TABLE)}
