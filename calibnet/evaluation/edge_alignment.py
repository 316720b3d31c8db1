"""A classical refinement without training, to hold the network against: edges of depth onto edges of the image.

After Levinson & Thrun, "Automatic online calibration of cameras and lasers" (2013): points at depth
discontinuities should fall on image edges. The score decays with the distance to the nearest edge, and
SciPy's Nelder-Mead simplex searches the six parameters.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from calibnet.datasets.frame import Frame
from calibnet.geometry import MiscalibrationRange, PinholeCamera, depth_image, project, transform
from calibnet.geometry.projection import nearest_per_cell
from calibnet.geometry.se3 import Matrix, rotation_from_vector
from calibnet.network.inputs import resize_image
from calibnet.trace import CascadeTrace, StageTrace

WIDTH = 620
"""Pixels of the image that edges are looked for in: half of KITTI's."""
REACH = 4.0
"""Pixels over which an edge's pull falls to 1/e."""
JUMP = 0.1
"""A point is at a discontinuity when a neighbour lies farther by this share of its depth, and by half a metre."""
NEIGHBOURHOOD = 4
"""Pixels within which neighbours are looked for."""
MINIMUM_POINTS = 30


class EdgeAlignment:
    """A `calibnet.evaluation.runner.Calibrator` without weights."""

    def __init__(self, bounds: MiscalibrationRange) -> None:
        """Search from a simplex of half of ``bounds``, as nothing beyond is to be found."""
        self.bounds = bounds

    def calibrate(self, frame: Frame, initial: Matrix, detail: bool = False) -> CascadeTrace:
        """Refine ``initial`` on one frame; it stays as it is where hardly a depth edge falls into the image."""
        from scipy.optimize import minimize

        camera = frame.camera.resized(WIDTH, max(1, round(frame.camera.height * WIDTH / frame.camera.width)))
        pull = edge_pull(frame, camera)
        points = discontinuities(frame.points, initial, camera)
        if len(points) < MINIMUM_POINTS:
            return self._trace(camera, initial, np.eye(4))

        def cost(vector: NDArray[np.float64]) -> float:
            seen = project(points, correction(vector) @ initial, camera)
            columns, rows = np.rint(seen.pixels).astype(int).T
            inside = pull[rows.clip(0, camera.height - 1), columns.clip(0, camera.width - 1)]
            return -float(inside.sum()) / len(points)  # what leaves the image gains nothing

        span = np.array([self.bounds.translation_m] * 3 + [np.radians(self.bounds.rotation_deg)] * 3) / 2
        simplex = np.concatenate([np.zeros((1, 6)), np.diag(span)])
        found = minimize(
            cost, np.zeros(6), method="Nelder-Mead", options={"initial_simplex": simplex, "maxfev": 600, "xatol": 1e-4}
        )
        return self._trace(camera, initial, correction(found.x))

    def _trace(self, camera: PinholeCamera, initial: Matrix, change: Matrix) -> CascadeTrace:
        return CascadeTrace(initial, (StageTrace(1, self.bounds, camera, initial, change @ initial, change),))


def correction(vector: NDArray[np.float64]) -> Matrix:
    """``(translation m, rotation vector rad)`` as 4x4."""
    return transform(rotation_from_vector(vector[3:]), vector[:3])


def edge_pull(frame: Frame, camera: PinholeCamera) -> NDArray[np.float32]:
    """``[H, W]``, 1 on an edge of the image and falling with the distance to one."""
    import cv2

    grey = cv2.cvtColor(resize_image(frame.image, camera), cv2.COLOR_RGB2GRAY)
    edges = cv2.Canny(cv2.GaussianBlur(grey, (0, 0), 1.0), 40, 120)
    distance = cv2.distanceTransform(255 - edges, cv2.DIST_L2, 3)
    pull: NDArray[np.float32] = np.exp(-distance / REACH).astype(np.float32)
    return pull


def discontinuities(
    points: NDArray[np.float32], camera_from_lidar: Matrix, camera: PinholeCamera
) -> NDArray[np.float32]:
    """The points ``[M, 4]`` in the image behind which, to one side, the scene falls away."""
    import cv2

    depth = depth_image(points, camera_from_lidar, camera)
    side = np.ones((1, 2 * NEIGHBOURHOOD + 1), np.uint8)
    farthest = cv2.dilate(depth, side)
    seen = project(points, camera_from_lidar, camera)
    winner = nearest_per_cell(seen, camera)
    rows, columns = np.nonzero((winner >= 0) & (farthest - depth > np.maximum(0.5, JUMP * depth)))
    return points[seen.index[winner[rows, columns]]]
