"""The synthetic world as training data: scenes rendered once and kept on disk."""

from __future__ import annotations

import io
import tempfile
from collections.abc import Iterator
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from calibnet.datasets import Frame
from calibnet.geometry import PinholeCamera
from calibnet.runtime.writing import write_whole

ROBOT_EVERY = 4
"""One of so many scenes is a robot's, mostly in a hall, instead of a car's."""


class SyntheticPool:
    """A ``Sequence`` of unrelated synthetic scenes, cars' and robots', each rendered once and then read from disk."""

    def __init__(self, size: int, seed: int, folder: Path | None = None) -> None:
        self.size, self.seed = size, seed
        self.folder = folder or Path(tempfile.gettempdir()) / "calib-inspect-scenes"
        self.name, self.rig = f"synthetic/{seed}", "synthetic world, random rigs"

    def __len__(self) -> int:
        return self.size

    def __iter__(self) -> Iterator[Frame]:
        return (self[position] for position in range(self.size))

    def __getitem__(self, position: int) -> Frame:
        """Scene ``position``; rendered if no earlier run left it in the folder."""
        robot = position % ROBOT_EVERY == ROBOT_EVERY - 1
        path = self.folder / f"{self.seed}-{position:06d}{'-robot' if robot else ''}.npz"
        if path.exists():
            try:
                return _unpack(path)
            except (ValueError, OSError, KeyError, EOFError, BadZipFile):  # cut short: draw it again
                path.unlink(missing_ok=True)
        from calibnet.datasets.synthetic import sample_frame, sample_robot_frame

        frame = (sample_robot_frame if robot else sample_frame)(self.seed * 1_000_000 + position)
        write_whole(path, _pack(frame))  # several processes may draw the same scene
        return frame


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
    with np.load(path, allow_pickle=False) as file:
        image = file["image"]
        camera = PinholeCamera(image.shape[1], image.shape[0], file["matrix"])
        return Frame(0, 0.0, image, file["points"], camera, file["camera_from_lidar"], str(path))
