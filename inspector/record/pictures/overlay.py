"""LiDAR points over the image: projected, thinned by a z-buffer and painted."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from calibnet.geometry import CameraModel
from calibnet.geometry.projection import Projection, nearest_per_cell
from inspector.record.pictures.painting import Painter, paint_depth


@dataclass(frozen=True)
class Thinning:
    """Density and precision of an overlay's points.

    Attributes:
        cells_across: number of z-buffer cells over the image's width, in each of which one point is kept.
        pixel: grid to which positions are rounded, in pixels; coarser numbers compress better.
    """

    cells_across: int
    pixel: float


@dataclass(frozen=True)
class Overlay:
    """Points to draw over an image, far to near so that near ones end on top.

    Attributes:
        pixels: ``[M, 2]`` float32, ``(u, v)``.
        colors: ``[M, 3]`` uint8.
        sizes: ``[M]`` float32, radii in screen points.
    """

    pixels: NDArray[np.float32] = field(repr=False)
    colors: NDArray[np.uint8] = field(repr=False)
    sizes: NDArray[np.float32] = field(repr=False)

    def archetype(self) -> rr.Points2D:
        """The points for Rerun, shifted by half a pixel since its pixel centres are at x.5."""
        sizes = self.sizes[:1] if len(np.unique(self.sizes)) < 2 else self.sizes
        return rr.Points2D(self.pixels + 0.5, colors=self.colors, radii=rr.Radius.ui_points(sizes))


def make_overlay(
    projection: Projection, camera: CameraModel, thinning: Thinning, paint: Painter = paint_depth
) -> Overlay:
    """Thin out a projected scan, keeping the nearest point of each cell.

    Args:
        projection: rows far to near, see `inspector.record.observation.Observation.projected`.
        camera: camera of the image.
        thinning: density of the points.
        paint: gives the colours and sizes of points.
    """
    stride = max(1, round(camera.width / thinning.cells_across))
    winner = nearest_per_cell(projection, camera, stride, np.arange(len(projection.depth)))
    kept = np.sort(winner[winner >= 0])
    pixels = np.round(projection.pixels[kept] / thinning.pixel) * thinning.pixel
    colors, sizes = paint(projection, kept)
    return Overlay(pixels.astype(np.float32), colors, sizes)
