"""From frames under extrinsics to a batch of network inputs: the one place, for training and inference.

LiDARs rarely see as far up as cameras: often the top quarter of the image or more holds no point. `Cut` crops those
rows from the LiDAR's part of a batch, and puts them back where results are shown; no other module has to count them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, TypeVar

import numpy as np
import torch
import torch.nn.functional as F
from numpy.typing import NDArray
from torch import Tensor

from calibnet.geometry import PinholeCamera, project
from calibnet.geometry.projection import cells_of_points
from calibnet.geometry.types import Extrinsic

Scalar = TypeVar("Scalar", bound=np.generic)


class LidarInput(NamedTuple):
    """A scan as the network sees it under one extrinsic.

    Attributes:
        image: ``[2, H, W]`` float32, sparse depth in metres (0 = empty) and intensity 0..1.
        cells: per scale, fine to coarse, ``[3, H/s, W/s]`` float32: the nearest point of each cell in
            the camera frame, zeros where there is none.
    """

    image: NDArray[np.float32]
    cells: list[NDArray[np.float32]]

    @property
    def occupied(self) -> NDArray[np.bool_]:
        """Cells of the finest scale, ``[h, w]``, that hold a point."""
        return self.cells[0][2] > 0


class NetworkInputs(NamedTuple):
    """A batch of frames under their initial extrinsics, at the network's input size.

    Attributes:
        image: ``[B, 3, H, W]`` RGB 0..255, any dtype.
        lidar: ``[B, 2, H', W]`` float32, sparse depth in metres (0 = empty) and intensity 0..1, of the lowest ``H'``
            rows of the image, see `Cut`.
        intrinsics: ``[B, 3, 3]`` float32.
        cells: per scale of `NetworkConfig.scales`, fine to coarse, ``[B, 3, H'/s, W/s]`` float32: the nearest LiDAR
            point of each cell in the camera frame, zeros where there is none. Scales without a cost volume are
            included, since rows are cropped at the coarsest scale that the encoder reaches.
    """

    image: Tensor
    lidar: Tensor
    intrinsics: Tensor
    cells: list[Tensor]

    def to(self, device: torch.device) -> NetworkInputs:
        """The batch on another device."""
        cells = [part.to(device) for part in self.cells]
        return NetworkInputs(self.image.to(device), self.lidar.to(device), self.intrinsics.to(device), cells)


class Cut(NamedTuple):
    """Rows at the top of the image without a point in any scan of a batch, cropped from the LiDAR's part of it.

    Attributes:
        rows: number of rows cropped, at the coarsest scale; at least one row stays.
        height: number of rows before cropping, at the coarsest scale.
    """

    rows: int
    height: int

    @classmethod
    def of(cls, scans: Sequence[LidarInput]) -> Cut:
        """The largest cut that loses no point of any scan."""
        occupied = np.any([(scan.cells[-1][2] > 0).any(axis=1) for scan in scans], axis=0)
        return cls(int(occupied.argmax()) if occupied.any() else len(occupied) - 1, len(occupied))

    def apply(self, array: NDArray[Scalar]) -> NDArray[Scalar]:
        """Crop the rows: ``[..., H, W]`` of any scale to ``[..., H', W]``."""
        return array[..., self.rows * (array.shape[-2] // self.height) :, :]

    def undo(self, tensor: Tensor) -> Tensor:
        """Put the rows back as zeros: ``[..., H', W]`` of any scale to ``[..., H, W]``."""
        missing = tensor.shape[-2] * self.rows // (self.height - self.rows)
        return F.pad(tensor, (0, 0, missing, 0))


def lidar_input(
    points: NDArray[np.float32], camera_from_lidar: Extrinsic, camera: PinholeCamera, scales: tuple[int, ...]
) -> LidarInput:
    """Project a scan ``[N, 4]`` and find the nearest point of each pixel and of each cell."""
    seen = project(points, camera_from_lidar, camera).sorted()  # far to near

    def nearest(stride: int, *of_points: NDArray[np.float32]) -> NDArray[np.float32]:
        size, cells = cells_of_points(seen, camera, stride)
        grid = np.zeros((len(of_points), *size), np.float32)
        for channel, values in zip(grid, of_points, strict=True):
            channel.reshape(-1)[cells] = values  # the last assignment wins: the nearest
        return grid

    image = nearest(1, seen.depth, points[seen.index, 3])
    return LidarInput(image, [nearest(scale, *seen.points.T) for scale in scales])


def make_batch(
    image: Tensor, scans: Sequence[LidarInput], intrinsics: Sequence[NDArray[np.floating]], cut: Cut | None = None
) -> NetworkInputs:
    """Stack frames of one input size.

    Args:
        image: ``[B, 3, H, W]``; the batch is put on its device.
        scans: the scan of each frame under its extrinsic.
        intrinsics: ``[3, 3]`` of each frame's input camera.
        cut: rows to crop from the scans; by default all above their points.
    """
    cut = cut or Cut.of(scans)

    def stack(arrays: Sequence[NDArray[np.generic]]) -> Tensor:
        return torch.from_numpy(np.stack(arrays)).to(image.device)

    return NetworkInputs(
        image,
        stack([cut.apply(scan.image) for scan in scans]),
        stack([matrix.astype(np.float32) for matrix in intrinsics]),
        [stack([cut.apply(cells) for cells in scale]) for scale in zip(*(scan.cells for scan in scans), strict=True)],
    )
