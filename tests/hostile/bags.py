"""Bags small enough to be changed at random."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from calibnet.datasets.frame import Frame
from calibnet.geometry import PinholeCamera
from tests.support.bags import write_bag
from tests.support.foreign_mcap import write_foxglove

AXES = np.array([[0.0, -1.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])


def small_frame() -> Frame:
    """With 40 points."""
    camera = PinholeCamera(16, 12, np.array([[9.0, 0.0, 7.5], [0.0, 9.0, 5.5], [0.0, 0.0, 1.0]]))
    points = np.random.default_rng(0).uniform([2, -2, -1, 0], [9, 2, 1, 1], (40, 4)).astype(np.float32)
    return Frame(0, 0.0, np.full((12, 16, 3), 90, np.uint8), points, camera, AXES, "bag")


def small_foxglove(encoding: str) -> bytes:
    """The bytes of an MCAP file of Foxglove's schemas with one frame, in ``json`` or ``protobuf``."""
    with tempfile.TemporaryDirectory() as folder:
        return write_foxglove(Path(folder) / "bag.mcap", encoding, [small_frame()]).read_bytes()


def small_bag(kind: str) -> bytes:
    """The bytes of a bag with one frame.

    Args:
        kind: its file's ending.
    """
    frame = small_frame()
    with tempfile.TemporaryDirectory() as folder:
        plugin = {".bag": "ros1", ".db3": "sqlite3", ".mcap": "mcap"}[kind]
        path = write_bag(Path(folder) / ("bag.bag" if kind == ".bag" else "bag"), plugin, [frame])
        file = path if kind == ".bag" else next(path.glob(f"*{kind}"))
        return file.read_bytes()
