"""A scene whose image shows its depth: boxes before a wall, scanned from the camera's own place."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from calibnet.datasets.frame import Frame
from calibnet.geometry import PinholeCamera, transform

REFERENCE = transform([[0, -1, 0], [0, 0, -1], [1, 0, 0]], [0.1, -0.2, -0.3])


def depth_picture(seed: int, width: int, height: int) -> NDArray[np.float64]:
    """Depth ``[H, W]`` in metres: a wall at 40 m and nearer boxes, the nearest in front."""
    generator = np.random.default_rng(seed)
    depth = np.full((height, width), 40.0)
    for near in np.sort(generator.uniform(5.0, 35.0, 14))[::-1]:
        w, h = generator.integers((width // 12, height // 5), (width // 4, height // 2))
        left, top = generator.integers((0, 0), (width - w, height - h))
        depth[top : top + h, left : left + w] = near
    return depth


def make_frame(seed: int = 0, width: int = 256, height: int = 96, points: int = 5000) -> Frame:
    """A frame with a dense scan; brightness falls with depth."""
    generator = np.random.default_rng([seed, 1])
    camera = PinholeCamera(
        width, height, np.array([[0.6 * width, 0.0, 0.5 * width], [0.0, 0.6 * width, 0.45 * height], [0.0, 0.0, 1.0]])
    )
    depth = depth_picture(seed, width, height)
    grey = np.clip(255 * 5.0 / depth, 0, 255)
    image = np.stack([grey, 255 - grey, grey**2 / 255], axis=-1).astype(np.uint8)
    pixel = generator.integers((0, 0), (width, height), (points, 2))
    ray = np.linalg.inv(camera.matrix) @ np.vstack([pixel.T, np.ones(points)])
    in_camera = (ray * depth[pixel[:, 1], pixel[:, 0]]).T
    in_lidar = (in_camera - REFERENCE[:3, 3]) @ REFERENCE[:3, :3]
    scan = np.concatenate([in_lidar, generator.uniform(size=(points, 1))], axis=1).astype(np.float32)
    return Frame(seed, 0.1 * seed, image, scan, camera, REFERENCE, f"scene {seed}")


class Scenes:
    """A ``Sequence`` of them that tells how often it was read."""

    name, rig = "scenes/00", "a camera that sees depth"

    def __init__(self, length: int = 3, on_read: Callable[[int], None] = lambda reads: None) -> None:
        self.frames = [make_frame(seed) for seed in range(length)]
        self.reads, self.on_read = 0, on_read

    def __len__(self) -> int:
        return len(self.frames)

    def __getitem__(self, position: int) -> Frame:
        self.reads += 1
        self.on_read(self.reads)
        return self.frames[position]

    def __iter__(self) -> Iterator[Frame]:
        return (self[position] for position in range(len(self)))
