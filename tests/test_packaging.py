"""The files that installation depends on agree with one another."""

from __future__ import annotations

import os
import re
import subprocess
import tomllib
from pathlib import Path

import pytest

from inspector.cli.errors import SYSTEM_PACKAGES

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
SCRIPT = ROOT / ".ci" / "system-libraries"


def normalized(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def test_constraints_pin_every_dependency_exactly() -> None:
    lines = [line for line in (ROOT / "constraints.txt").read_text().splitlines() if line and not line.startswith("#")]
    assert all(re.fullmatch(r"[\w.-]+==[\w.]+", line) for line in lines), "name==version only: no builds, no addresses"
    pinned = {normalized(line.partition("==")[0]) for line in lines}
    project = PROJECT["project"]
    extras = [requirement for extra in project["optional-dependencies"].values() for requirement in extra]
    names = {normalized(re.split(r"[<>=!~\[; ]", requirement)[0]) for requirement in project["dependencies"] + extras}
    assert names - {project["name"]} <= pinned, "one extra may include another"


def test_the_script_and_the_error_messages_know_the_same_libraries() -> None:
    in_script = dict(re.findall(r"^(lib\S+?\.so[.\d]*):(\S+)$", SCRIPT.read_text(), flags=re.MULTILINE))
    assert in_script == SYSTEM_PACKAGES


def run_without_libraries(tmp_path: Path, user: str) -> subprocess.CompletedProcess[str]:
    """Run the script with an ``ldconfig`` that knows no library, as ``user``, and an ``apt-get`` that only tells."""
    for name, body in {
        "ldconfig": "true",
        "id": f"echo {user}",
        "apt-get": 'echo "apt-get $*" >> "$APT_LOG"',
    }.items():
        (tmp_path / name).write_text(f"#!/bin/sh\n{body}\n")
        (tmp_path / name).chmod(0o755)
    environment = {"PATH": f"{tmp_path}{os.pathsep}{os.environ['PATH']}", "APT_LOG": str(tmp_path / "apt.log")}
    return subprocess.run([SCRIPT], env=environment, capture_output=True, text=True, timeout=60, check=False)


@pytest.mark.skipif(os.uname().sysname != "Linux", reason="the script is for Linux")
def test_missing_libraries_are_named_in_one_line_with_the_command(tmp_path: Path) -> None:
    done = run_without_libraries(tmp_path, user="1000")
    assert done.returncode == 1
    assert done.stdout == ""
    assert len(done.stderr.splitlines()) == 1
    assert re.search(r"sudo apt-get install -y --no-install-recommends .*\blibusb-1\.0-0\b", done.stderr)
    assert not (tmp_path / "apt.log").exists()


@pytest.mark.skipif(os.uname().sysname != "Linux", reason="the script is for Linux")
def test_root_installs_missing_libraries_after_an_update(tmp_path: Path) -> None:
    assert run_without_libraries(tmp_path, user="0").returncode == 0
    update, install = (tmp_path / "apt.log").read_text().splitlines()
    assert update.startswith("apt-get update")
    assert install.startswith("apt-get install -y")
    assert set(SYSTEM_PACKAGES.values()) <= set(install.split())
