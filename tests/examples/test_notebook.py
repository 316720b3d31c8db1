"""The notebook runs from its first cell to its last, and shows what it says."""

from __future__ import annotations

import os
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

NOTEBOOK = Path(__file__).resolve().parents[2] / "examples" / "notebook.ipynb"


@pytest.fixture(scope="module")
def executed() -> nbformat.NotebookNode:
    os.environ.setdefault("MPLBACKEND", "module://matplotlib_inline.backend_inline")
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    NotebookClient(notebook, timeout=600, resources={"metadata": {"path": str(NOTEBOOK.parents[1])}}).execute()
    return notebook


def outputs(notebook: nbformat.NotebookNode, containing: str) -> list[nbformat.NotebookNode]:
    """What the one cell whose source contains this text put out."""
    (cell,) = [cell for cell in notebook.cells if cell.cell_type == "code" and containing in cell.source]
    found: list[nbformat.NotebookNode] = cell.outputs
    return found


def test_the_error_falls(executed: nbformat.NotebookNode) -> None:
    lines = "".join(part["text"] for part in outputs(executed, "pose_error(extrinsic")).splitlines()
    errors = {line.split("  ")[0].strip(): float(line.split("°")[0].split()[-1]) for line in lines}
    assert 3.7 < errors["initially"] < 3.8, "roll 2, pitch -1, yaw 3 degrees"
    assert errors["after stage 5"] < 1.0


def test_the_viewer_and_the_curve_are_shown(executed: nbformat.NotebookNode) -> None:
    assert any(
        "application/vnd.jupyter.widget-view+json" in part.get("data", {})
        for part in outputs(executed, "notebook_show")
    )
    assert any("image/png" in part.get("data", {}) for part in outputs(executed, "plt.plot"))


def test_no_outputs_are_kept_in_the_file() -> None:
    assert not any(cell.get("outputs") for cell in nbformat.read(NOTEBOOK, as_version=4).cells)
