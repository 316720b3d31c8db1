"""Other packages' datasets, heads, methods and formats on the command line, in a fresh process."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import click
import pytest

from inspector.cli.errors import run
from inspector.export.exported import Exported
from inspector.export.registry import export_as
from tests.support.fakes import REFERENCE, make_frame
from tests.support.toy_package import install_toys

ROOT = Path(__file__).resolve().parents[3]


def start(folder: Path, *arguments: str, code: str = "") -> subprocess.CompletedProcess[str]:
    """Run the command line, or ``code``, as a user does who has installed what is in the folder."""
    environment = {**os.environ, "PYTHONPATH": f"{folder}{os.pathsep}{ROOT}", "COLUMNS": "200"}
    return subprocess.run(
        [sys.executable, *(["-c", code] if code else ["-m", "inspector", *arguments])],
        env=environment,
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


HELPS = {
    "evaluate": ("folder|broken|toy", "edge-alignment|", "|broken|nothing"),
    "folder": ("folder|broken|toy", "cascade|edge-alignment|", "|broken|nothing"),
    "export": ("kitti|ros|opencv|json|yaml|urdf|autoware|koide3|broken|csv",),
    "train": ("geometric|regression|broken|still",),
}


def test_help_lists_them_whatever_is_broken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install_toys(tmp_path, monkeypatch)
    code = "from inspector.cli.errors import run\nfrom inspector.cli.main import cli\n"
    code += f"for command in {list(HELPS)}:\n    print('CODE', run(cli, [command, '--help']))\n"
    done = start(tmp_path, code=code)
    assert done.returncode == 0, done.stderr
    texts = done.stdout.split("CODE 0\n")
    assert len(texts) == len(HELPS) + 1
    for text, names in zip(texts, HELPS.values(), strict=False):
        assert all(name in "".join(text.split()) for name in names)


def test_a_broken_one_is_one_sentence_when_it_is_asked_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install_toys(tmp_path, monkeypatch)
    done = start(tmp_path, "folder", str(tmp_path), "--dataset", "broken")
    assert done.returncode == 3
    assert done.stderr.startswith("calib-inspect: The dataset 'broken' of package broken_package cannot be imported (")
    assert len(done.stderr.splitlines()) == 1


def test_a_dataset_of_another_package_is_calibrated(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install_toys(tmp_path, monkeypatch)
    done = start(tmp_path, "folder", str(tmp_path), "--dataset", "toy", "--headless", "--frames", "9")
    assert (done.returncode, done.stdout) == (3, "")
    assert f"Frames '9' select nothing of toy/{tmp_path.name}; choose from its 2 frames" in done.stderr


BODIES = {
    "f = 5": (3, "The export format 'mine' of package mine cannot be imported (TypeError: it is neither a class nor"),
    "raise SystemExit(0)": (3, "The export format 'mine' of package mine cannot be imported (SystemExit: 0)"),
    "def f(e): raise ValueError('bad')": (
        70,
        "Internal error in the package mine (ValueError: bad). Please report",
    ),
    "def f(e): raise SystemExit(0)": (
        70,
        "Internal error in the package mine (SystemExit: 0). Please report",
    ),
    "def f(e): return 5": (3, "The export format 'mine' returns int instead of text; update its package."),
}


@pytest.mark.parametrize("body", BODIES)
def test_what_a_package_does_wrong_is_put_down_to_it(
    body: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    module = f"mine_{list(BODIES).index(body)}"
    (tmp_path / f"{module}.py").write_text(body)
    registered = tmp_path / "mine-1.0.dist-info"
    registered.mkdir()
    (registered / "METADATA").write_text("Metadata-Version: 2.1\nName: mine\nVersion: 1.0\n")
    (registered / "entry_points.txt").write_text(f"[calib_inspect.exports]\nmine = {module}:f\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr(tempfile, "tempdir", None)

    @click.command()
    def command() -> None:
        export_as("mine", Exported(REFERENCE, make_frame(0).camera, "a run"))

    code, sentence = BODIES[body]
    assert run(command, []) == code
    assert capsys.readouterr().err.startswith(f"calib-inspect: {sentence}")
