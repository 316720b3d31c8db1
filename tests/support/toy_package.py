"""Packages as they lie in a folder of Python's path once they are installed: a module and its entry points."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

TOY = '''
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch

from calibnet.network.pose import Pose
from calibnet.trace import CascadeTrace, StageTrace
from tests.support.drive import Drive


class Frames(Drive):
    """Two frames, whatever is in the folder."""

    def __init__(self, root, first=0):
        super().__init__([first, first + 1], name=f"toy/{Path(root).name}")

    def __getitem__(self, position):
        return replace(super().__getitem__(range(len(self))[position]), source="a toy")


class Still(torch.nn.Module):
    """A head that corrects nothing."""

    def __init__(self, config, range_):
        super().__init__()

    def forward(self, field, cells, intrinsics):
        return Pose(torch.eye(4).repeat(len(cells), 1, 1), None)


class Nothing:
    """A method that corrects nothing."""

    def __init__(self, range_):
        self.range = range_

    def calibrate(self, frame, initial, detail=False):
        return CascadeTrace(initial, (StageTrace(1, self.range, frame.camera, initial, initial, np.eye(4)),))


def as_csv(exported):
    return ",".join(map(repr, exported.camera_from_lidar.ravel().tolist())) + f"\\n# {exported.origin}\\n"
'''

ENTRY_POINTS = """
[calib_inspect.datasets]
toy = toy_package:Frames
folder = toy_package:Frames

[calib_inspect.heads]
still = toy_package:Still

[calib_inspect.methods]
nothing = toy_package:Nothing

[calib_inspect.exports]
csv = toy_package:as_csv
"""


def install(folder: Path, name: str, module: str, entry_points: str) -> None:
    """Put a package into a folder as an installer would."""
    (folder / f"{name}.py").write_text(module)
    information = folder / f"{name}-1.0.dist-info"
    information.mkdir()
    (information / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    (information / "entry_points.txt").write_text(entry_points)


def install_toys(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A good package and one that cannot be imported."""
    broken = "".join(
        f"[calib_inspect.{group}]\nbroken = broken_package:Thing\n"
        for group in ("datasets", "heads", "methods", "exports")
    )
    install(folder, "broken_package", "import no_such_library_of_its\n", broken)
    install(folder, "toy_package", TOY, ENTRY_POINTS)
    monkeypatch.syspath_prepend(str(folder))
    monkeypatch.delitem(sys.modules, "toy_package", raising=False)
