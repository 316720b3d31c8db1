"""A drive without files, for what is measured on sequences."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from calibnet.datasets import Frame
from calibnet.geometry import PinholeCamera, transform

CAMERA = PinholeCamera(64, 32, np.array([[50.0, 0, 31.5], [0, 50.0, 15.5], [0, 0, 1]]))
REFERENCE = transform([[0, -1, 0], [0, 0, -1], [1, 0, 0]], [0.1, -0.2, -0.3])


@dataclass
class Drive:
    """Frames numbered as given, of one brightness; with ``moving``, each has a mount of its own."""

    numbers: list[int]
    name: str = "test/drive"
    rig: str = "test rig"
    brightness: int = 0
    moving: bool = False

    def __len__(self) -> int:
        return len(self.numbers)

    def __getitem__(self, position: int) -> Frame:
        frame = Frame(
            index=self.numbers[position],
            timestamp=0.1 * position,
            image=np.full((32, 64, 3), self.brightness, np.uint8),
            points=np.zeros((1, 4), np.float32),
            camera=CAMERA,
            camera_from_lidar=REFERENCE,
        )
        if not self.moving:
            return frame
        return replace(frame, camera_from_lidar=transform(REFERENCE[:3, :3], [position, 0, 0]))

    def index_of(self, position: int) -> int:
        return self.numbers[position]

    def __iter__(self) -> Iterator[Frame]:
        return (self[position] for position in range(len(self)))
