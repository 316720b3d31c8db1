"""Whole inputs that rows damage: a car's folder, KITTI's layouts, and the commands that read them."""

from __future__ import annotations

import functools
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path

from tests.calibnet.datasets.conftest import LAYOUTS
from tests.support.folder import write_folder

Build = Callable[[Path], list[str]]
CAR = "car"
RUN = ["--frames", "0", "--headless", "--detail", "overview"]
"""One frame, which a damage of it ends the run for."""


@functools.cache
def _originals() -> Path:
    """One of each, made once and copied for every row."""
    made = Path(tempfile.mkdtemp(prefix="calib-inspect-hostile-"))
    write_folder(made / CAR, 1)
    for name, write in LAYOUTS.items():
        write(made / name)
    return made


def put(name: str, root: Path, called: str | None = None) -> Path:
    """A copy of an original."""
    return Path(shutil.copytree(_originals() / name, root / (called or name)))


def car(root: Path) -> list[str]:
    """Calibrate the one frame of a car's folder."""
    put(CAR, root)
    return ["folder", CAR, *RUN]


def car_with(usual: str, suffix: str, content: bytes) -> Build:
    """Calibrate a car's folder in which this stands in the place of one file."""

    def made(root: Path) -> list[str]:
        command = car(root)
        file = root / CAR / usual
        file.unlink()
        file.with_suffix(suffix).write_bytes(content)
        return command

    return made


def car_exported(root: Path) -> list[str]:
    """Export the calibration of a car's folder, which reads nothing else of it."""
    put(CAR, root)
    return ["export", "--folder", CAR, "--format", "json"]


def odometry(root: Path) -> list[str]:
    """A sequence of KITTI odometry."""
    put("kitti-odometry", root)
    return ["seq", "04", "--root", "kitti-odometry", *RUN]


def raw(root: Path) -> list[str]:
    """A drive of KITTI raw."""
    put("kitti-raw", root)
    return ["raw", "2011_01_02", "0007", "--root", "kitti-raw", *RUN]


def listed(root: Path) -> list[str]:
    """A list of KITTI object frames."""
    put("kitti-object", root)
    return ["object", "--split", "val", "--root", "kitti-object", *RUN]


def changed(build: Build, place: str, content: bytes | str | Callable[[bytes], bytes]) -> Build:
    """The same input with one file changed, or made."""

    def made(root: Path) -> list[str]:
        command = build(root)
        path = root / place
        if callable(content):
            path.write_bytes(content(path.read_bytes()))
        else:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content.encode("utf-8", "surrogateescape") if isinstance(content, str) else content)
        return command

    return made
