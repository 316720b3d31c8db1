"""Keeps all frames of a training run as tensors on one device."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from calibnet.datasets.frame import Frame
from calibnet.errors import ConfigError
from calibnet.geometry import PinholeCamera
from calibnet.geometry.types import Extrinsic
from calibnet.runtime.threads import cores
from calibnet.training.data import Source

LARGEST_BYTES = 16 << 30
"""Largest size of all frames together on the device."""


@dataclass(frozen=True)
class FrameStore:
    """Images and scans of F frames on the device; the rest of each frame, which is small, on the host.

    Attributes:
        images: ``[F, H, W, 3]`` uint8 RGB at the size of the largest image; smaller ones are padded with black.
        scans: ``[F, 4, N]`` float32 (x, y, z in metres, intensity), padded to the size of the largest scan.
        points: ``[F]`` number of points of each scan.
        cameras: camera of each frame.
        extrinsics: F times 4x4 float64 camera_from_lidar.
        first: number of the first frame of each source.
    """

    images: Tensor
    scans: Tensor
    points: Tensor
    cameras: list[PinholeCamera]
    extrinsics: list[Extrinsic]
    first: list[int]

    @property
    def device(self) -> torch.device:
        """The device of images and scans."""
        return self.images.device

    @classmethod
    def load(cls, sources: Sequence[Source], device: torch.device) -> FrameStore:
        """Read all frames of the sources, with as many threads as there are cores.

        Raises:
            ConfigError: the frames would take too much memory.
            DatasetError: a frame cannot be read.
        """
        places = [(source.sequence, position) for source in sources for position in range(len(source.sequence))]
        lengths = [len(source.sequence) for source in sources]
        frames, height, width, most = list[Frame](), 0, 0, 0
        threads = ThreadPoolExecutor(cores())
        try:
            for frame in threads.map(lambda place: place[0][place[1]], places):
                frames.append(frame)
                height, width = max(height, frame.image.shape[0]), max(width, frame.image.shape[1])
                most = max(most, len(frame.points))
                require_room(len(places), height, width, most)
        finally:
            threads.shutdown(cancel_futures=True)
        images = torch.zeros(len(frames), height, width, 3, dtype=torch.uint8, device=device)
        scans = torch.zeros(len(frames), 4, most, device=device)
        for number, frame in enumerate(frames):
            put(images[number], scans[number], frame)
        return cls(
            images,
            scans,
            torch.tensor([len(frame.points) for frame in frames], device=device),
            [frame.camera for frame in frames],
            [frame.camera_from_lidar for frame in frames],
            [0, *np.cumsum(lengths)[:-1].tolist()],
        )


def require_room(frames: int, height: int, width: int, points: int) -> None:
    """Check that this number of frames fits onto the device, padded to the largest image and scan.

    Raises:
        ConfigError: the frames would take too much memory.
    """
    size = frames * (3 * height * width + 16 * points)
    if size > LARGEST_BYTES:
        raise ConfigError(
            f"The {frames:,d} training frames would take {size / 2**30:.0f} GiB of the device's memory, more "
            f"than {LARGEST_BYTES >> 30}; pack fewer, or train without --on-device."
        )


def put(image: Tensor, scan: Tensor, frame: Frame) -> None:
    """Copy a frame into its place ``[H, W, 3]`` and ``[4, N]``."""
    height, width = frame.image.shape[:2]
    image[:height, :width] = torch.from_numpy(frame.image)
    scan[:, : len(frame.points)] = torch.from_numpy(np.ascontiguousarray(frame.points.T))
