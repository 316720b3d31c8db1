"""What every test shares: one thread a process, and the folders of real frames where they exist."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

# The suite runs one process a core; before torch or OpenCV are imported.
os.environ.setdefault("OMP_NUM_THREADS", "1")

SHARED = Path(__file__).resolve().parents[2] / "shared"


def existing(folder: Path) -> Path:
    """The folder, or a skip that says what is missing."""
    if not folder.is_dir():
        pytest.skip(f"no real frames: ../shared/{folder.relative_to(SHARED)} is not there")
    return folder


@pytest.fixture(scope="session")
def kitti_folder() -> Path:
    """KITTI frames: ``odometry``, ``raw`` and ``object`` lie below it."""
    return existing(SHARED / "kitti")
