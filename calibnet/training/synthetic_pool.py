"""The synthetic world as training data: scenes rendered once and kept on disk.

The file names contain a hash of the source code of `calibnet.datasets.synthetic`, so that scenes are rendered again
when that code changes.
"""

from __future__ import annotations

import ast
import hashlib
import io
import os
import tempfile
from collections.abc import Iterator, Mapping
from functools import cache
from importlib import resources
from pathlib import Path
from zipfile import BadZipFile, ZipFile

import numpy as np

from calibnet.datasets import Frame
from calibnet.errors import DatasetError
from calibnet.geometry import PinholeCamera
from calibnet.runtime.reading import MEGABYTE, read_file
from calibnet.runtime.writing import write_whole

LARGEST = 64 * MEGABYTE
"""Largest size of a scene in bytes, packed or not; usual scenes have 3 to 5 MB."""
ROBOT_EVERY = 4
"""One scene of this many is a robot's, mostly in a hall; the others are a car's."""


class SyntheticPool:
    """A `Sequence` of unrelated synthetic scenes of cars and robots, each rendered once and then read from disk."""

    def __init__(self, size: int, seed: int, folder: Path | None = None) -> None:
        self.size, self.seed = size, seed
        self.folder = folder or Path(tempfile.gettempdir()) / "calib-inspect-scenes"
        self.name, self.rig = f"synthetic/{seed}", "synthetic world, random rigs"

    def __len__(self) -> int:
        return self.size

    def __iter__(self) -> Iterator[Frame]:
        return (self[position] for position in range(self.size))

    def __getitem__(self, position: int) -> Frame:
        """Scene ``position``, from the folder if it is there, otherwise rendered."""
        robot = position % ROBOT_EVERY == ROBOT_EVERY - 1
        kind = "robot" if robot else "car"
        path = self.folder / f"{world_version()}-{self.seed}-{position:06d}-{kind}.npz"
        if os.path.lexists(path):
            try:
                return _unpack(path)
            except (
                ValueError,
                DatasetError,
                KeyError,
                EOFError,
                BadZipFile,
            ):  # cut short, or another file: render it again
                path.unlink(missing_ok=True)
        from calibnet.datasets.synthetic import sample_frame, sample_robot_frame

        frame = (sample_robot_frame if robot else sample_frame)(self.seed * 1_000_000 + position)
        write_whole(path, _pack(frame))  # several processes may draw the same scene
        return frame


@cache
def world_version() -> str:
    """Eight hexadecimal digits that change with the code that renders scenes."""
    folder = resources.files("calibnet.datasets.synthetic")
    sources = (entry for entry in folder.iterdir() if entry.name.endswith(".py"))
    return version_of({source.name: source.read_text(encoding="utf-8") for source in sources})


def version_of(sources: Mapping[str, str]) -> str:
    """Hash, eight hexadecimal digits, of Python sources by file name; comments and docstrings do not count."""
    digest = hashlib.sha256()
    for name in sorted(sources):
        tree = ast.parse(sources[name])
        for node in ast.walk(tree):
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
                node.body = [statement for statement in node.body if not _is_docstring(statement)]
        digest.update(f"{name}\n{ast.dump(tree)}\n".encode())
    return digest.hexdigest()[:8]


def _is_docstring(node: ast.stmt) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)


def _pack(frame: Frame) -> bytes:
    buffer = io.BytesIO()
    np.savez(
        buffer,
        image=frame.image,
        points=frame.points,
        matrix=frame.camera.matrix,
        camera_from_lidar=frame.camera_from_lidar,
    )
    return buffer.getvalue()


def _unpack(path: Path) -> Frame:
    data = io.BytesIO(read_file(path, "Synthetic scene", LARGEST, remedy="remove it"))
    if sum(member.file_size for member in ZipFile(data).infolist()) > LARGEST:
        raise ValueError("unpacked it is larger than any scene")
    with np.load(data, allow_pickle=False) as file:
        image, points = file["image"], file["points"]
        if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3 or points.ndim != 2:
            raise ValueError("it has no image or no points")
        camera = PinholeCamera(image.shape[1], image.shape[0], file["matrix"])
        return Frame(0, 0.0, image, points, camera, file["camera_from_lidar"], str(path))
