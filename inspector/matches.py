"""The cell that the cost-volume views point at, and where it truly belongs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibnet.geometry import project
from calibnet.geometry.projection import nearest_per_cell
from calibnet.trace import StageDetail, StageTrace
from inspector.observation import Observation


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


def chosen_match(observation: Observation, stage: StageTrace, results: StageDetail) -> Match | None:
    """The nearest point of the cell the stage is surest of; None if no cell holds a point.

    Cells whose search window reaches over the image's border are passed over where others exist.
    """
    finest = results.scales[0]
    camera = observation.trace.camera
    projection = project(observation.frame.points, stage.before, camera)
    winner = nearest_per_cell(projection, camera, finest.stride)
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
    u, v = (float(value) for value in projection.pixels[point])
    if observation.reference is None:
        return Match((u, v), None)
    scan_row = projection.index[point]
    in_reference = observation.reference @ np.append(observation.frame.points[scan_row, :3], 1.0)
    true_u, true_v = (camera.matrix @ in_reference[:3])[:2] / in_reference[2]
    return Match((u, v), (float(true_u) - u, float(true_v) - v))
