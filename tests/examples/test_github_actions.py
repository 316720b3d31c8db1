"""The example workflow: valid YAML, and commands that exist with the options it gives them."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Any

import click
import pytest
import yaml

from inspector.cli.main import cli

WORKFLOW = Path(__file__).resolve().parents[2] / "examples" / "github-actions" / "calibration.yml"


@pytest.fixture(scope="module")
def workflow() -> dict[Any, Any]:
    content: dict[Any, Any] = yaml.safe_load(WORKFLOW.read_text(encoding="utf-8"))
    return content


@pytest.fixture(scope="module")
def steps(workflow: dict[Any, Any]) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = workflow["jobs"]["calibration"]["steps"]
    return found


def command_of(steps: list[dict[str, Any]], name: str, variables: dict[str, str]) -> list[str]:
    """The arguments of `calib-inspect` in a step, with the workflow's variables filled in."""
    (text,) = [step["run"] for step in steps if step.get("name") == name]
    for variable, value in variables.items():
        text = text.replace(f"${variable}", value)
    program, *arguments = shlex.split(text.partition("|")[0])
    assert program == "calib-inspect"
    return arguments


@pytest.mark.parametrize("step", ["Record", "Check", "Report"])
def test_the_commands_are_ours_with_options_they_have(
    workflow: dict[Any, Any], steps: list[dict[str, Any]], step: str
) -> None:
    name, *arguments = command_of(steps, step, workflow["env"])
    command = cli.get_command(click.Context(cli), name)
    assert command is not None
    command.make_context(name, arguments)  # parses and raises for an option or a value that is not known


def test_what_is_checked_and_reported_is_what_was_recorded(
    workflow: dict[Any, Any], steps: list[dict[str, Any]]
) -> None:
    record, check, report = (command_of(steps, name, workflow["env"]) for name in ("Record", "Check", "Report"))
    saved = record[record.index("--save") + 1]
    assert "--headless" in record
    assert check[1] == report[1] == saved
    assert "--junit" in check
    assert Path(saved).parts[0] == workflow["env"]["OUT"]


def test_recording_and_report_are_kept_when_the_check_fails(steps: list[dict[str, Any]]) -> None:
    keep = steps[-1]
    assert keep["uses"].startswith("actions/upload-artifact@")
    assert keep["with"]["path"] == "${{ env.OUT }}"
    for step in steps[-2:]:
        assert "always()" in step["if"]
