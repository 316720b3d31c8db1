"""Initial and true positions of a stage's cells, and the one cell whose search window is shown."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from calibnet.geometry import PinholeCamera, project, transform
from calibnet.geometry.projection import Projection, nearest_per_cell
from calibnet.trace import StageDetail, StageTrace
from inspector.record.observation import Observation


@dataclass(frozen=True, eq=False)
class StartingPoints:
    """The scan in the network's image before a stage.

    Attributes:
        camera: the camera of the network's image.
        projection: the scan projected under the stage's initial extrinsic, rows far to near.
        displacement: ``[M, 2]`` float32 pixels ``(dx, dy)`` to where the reference puts each point; None without one.
    """

    camera: PinholeCamera
    projection: Projection = field(repr=False)
    displacement: NDArray[np.float32] | None = field(repr=False)

    @classmethod
    def of(cls, observation: Observation, stage: StageTrace) -> StartingPoints:
        """The scan as projected by the stage; the network's image is the frame's, turned upright and resized."""
        camera, reference, frame = stage.camera, observation.reference, observation.frame
        if stage.upright is None and frame.original is None:
            projection = observation.projected(stage.before)
            scale = np.array([camera.width / frame.camera.width, camera.height / frame.camera.height], dtype=np.float32)
            pixels = (projection.pixels + 0.5) * scale - 0.5  # pixel centres are at integers
            projection = replace(projection, pixels=pixels)
        else:
            upright = np.eye(4) if stage.upright is None else transform(stage.upright, np.zeros(3))
            reference = None if reference is None else upright @ reference
            projection = project(frame.points, upright @ stage.before, camera).sorted()
            pixels = projection.pixels
        if reference is None:
            return cls(camera, projection, None)
        to_image = (camera.matrix @ reference[:3]).astype(np.float32)
        true = frame.points[projection.index, :3] @ to_image[:, :3].T + to_image[:, 3]
        ahead = np.maximum(true[:, 2:], 1e-3)  # a point behind the true camera is far off in any case
        return cls(camera, projection, true[:, :2] / ahead - pixels)

    def nearest(self, stride: int) -> NDArray[np.int64]:
        """``[h, w]``: row of the nearest point of each cell, -1 in empty cells."""
        return nearest_per_cell(self.projection, self.camera, stride, np.arange(len(self.projection.depth)))

    def true_field(self, stride: int) -> NDArray[np.float32] | None:
        """``[h, w, 2]`` pixels: the true displacement of each cell's nearest point, 0 in empty cells."""
        if self.displacement is None:
            return None
        winner = self.nearest(stride)
        return np.where((winner >= 0)[..., None], self.displacement[winner], np.float32(0.0))


@dataclass(frozen=True)
class Match:
    """A LiDAR point in the network's image.

    Attributes:
        pixel: ``(u, v)`` where the stage's starting extrinsic puts it.
        true_displacement: ``(dx, dy)`` in pixels to where the reference puts it; None without one.
    """

    pixel: tuple[float, float]
    true_displacement: tuple[float, float] | None

    def cell(self, stride: int) -> tuple[int, int]:
        """Column and row of the cell that holds the pixel."""
        return int((self.pixel[0] + 0.5) // stride), int((self.pixel[1] + 0.5) // stride)


def chosen_match(points: StartingPoints, results: StageDetail) -> Match | None:
    """The nearest point of the cell with the highest confidence; None if all cells are empty.

    Cells whose search window extends over the image's border are used only if there are no others.
    """
    finest = results.scales[0]
    winner = points.nearest(finest.stride)
    candidates = (winner >= 0) & finest.occupied
    inner = np.zeros_like(candidates)
    margin_y, margin_x = finest.volume.shape[0] // 2, finest.volume.shape[1] // 2
    inner[margin_y:-margin_y, margin_x:-margin_x] = True
    if (candidates & inner).any():
        candidates &= inner
    if not candidates.any():
        return None
    surest = int(np.argmax(np.where(candidates, results.confidence, -1.0)))
    point = winner.reshape(-1)[surest]
    true = None if points.displacement is None else _pair(points.displacement[point])
    return Match(_pair(points.projection.pixels[point]), true)


def match_of(points: StartingPoints, row: int) -> Match | None:
    """The match of a point of the scan, by its row; None if it is outside the network's image."""
    (found,) = np.nonzero(points.projection.index == row)
    if not len(found):
        return None
    true = None if points.displacement is None else _pair(points.displacement[found[0]])
    return Match(_pair(points.projection.pixels[found[0]]), true)


def point_at(projection: Projection, pixel: tuple[float, float], reach: float) -> int | None:
    """Row of the point that is projected nearest to a pixel, and of two equally near ones, the closer one in space.

    Args:
        projection: the projected scan.
        pixel: the pixel ``(u, v)``.
        reach: largest distance in pixels; None is returned if no point is within it.
    """
    off = np.linalg.norm(projection.pixels - np.asarray(pixel, np.float32), axis=1)
    near = np.flatnonzero(off <= reach)
    if not len(near):
        return None
    best = near[np.lexsort((projection.depth[near], np.round(off[near] / max(reach / 4, 1e-6))))[0]]
    return int(projection.index[best])


def _pair(values: NDArray[np.float32]) -> tuple[float, float]:
    return float(values[0]), float(values[1])
