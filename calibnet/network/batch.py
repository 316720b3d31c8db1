"""From a frame and an extrinsic to the network's input; one place for training and inference."""

from __future__ import annotations

from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

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
    def empty_rows(self) -> int:
        """Rows of the coarsest scale, from the top, that hold no point; all but one if there is none at all.

        Scanners look down more than cameras do: often a quarter of the picture and more.
        """
        occupied = (self.cells[-1][2] > 0).any(axis=1)
        return int(occupied.argmax()) if occupied.any() else len(occupied) - 1

    def without_top(self, rows: int) -> LidarInput:
        """Without so many rows of the coarsest scale: nothing is lost if they are empty, and work is saved."""
        return LidarInput(
            below(self.image, rows, self.cells[-1]), [below(cells, rows, self.cells[-1]) for cells in self.cells]
        )


def below(array: NDArray[Scalar], rows: int, coarsest: NDArray[np.float32]) -> NDArray[Scalar]:
    """``[..., H, W]`` of any scale without its top, given in rows of ``coarsest [3, h, w]``."""
    return array[..., rows * (array.shape[-2] // coarsest.shape[-2]) :, :]


def lidar_input(
    points: NDArray[np.float32], camera_from_lidar: Extrinsic, camera: PinholeCamera, scales: tuple[int, ...]
) -> LidarInput:
    """Project a scan ``[N, 4]`` and find the nearest point of each pixel and of each cell."""
    projection = project(points, camera_from_lidar, camera)
    far_to_near = projection.far_to_near()

    def nearest(stride: int, *of_points: NDArray[np.float32]) -> NDArray[np.float32]:
        size, cells = cells_of_points(projection, camera, stride)
        cells = cells[far_to_near]
        grid = np.zeros((len(of_points), *size), np.float32)
        for channel, values in zip(grid, of_points, strict=True):
            channel.reshape(-1)[cells] = values[far_to_near]  # the last assignment wins: the nearest
        return grid

    image = nearest(1, projection.depth, points[projection.index, 3])
    return LidarInput(image, [nearest(scale, *projection.points.T) for scale in scales])
