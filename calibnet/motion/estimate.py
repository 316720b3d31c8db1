"""Gathers pairs of successive frames of a drive, and reads from them what their motion shows."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from calibnet.datasets.frame import Frame
from calibnet.geometry import PinholeCamera, transform_points
from calibnet.geometry.se3 import pose_from_vector
from calibnet.geometry.types import Extrinsic, Floats
from calibnet.motion.fit import LENSES, POSE, Fit, Pair, Problem, seen
from calibnet.motion.odometry import motion_between
from calibnet.motion.surface import NEAREST_M, NEIGHBOURS
from calibnet.motion.tracks import corners, tracked
from calibnet.trace import LensReading, MotionEstimate

LEAST_MOTION_M = 0.3
"""Shortest way between two frames that is used."""
FEWEST_TRACKS = 30
"""Fewest tracks of a pair that is used."""
FEWEST_PAIRS = 4
"""Fewest pairs that are read."""
STUCK = 0.03
"""Share of the cost that another lens has to save for the pose alone to be fitted again from that result."""
WIDER = 4.0
"""Factor on the covariance that the differences between pairs show."""
COMMON = np.array([0.05] * 3 + [np.radians(0.2)] * 3)
"""Standard deviations, in metres and radians, of the errors that all pairs have in common: of the registration, the
shutters, and of what is left of the lens's distortion."""
MARGIN_PX = 40
"""Points of the scan that are this far outside the image are kept, as the fit may move them into it."""


class MotionPairs:
    """Pairs of successive frames of one camera on one mount."""

    def __init__(self, extrinsic: Extrinsic) -> None:
        """Expect motion in the image under ``extrinsic``, which is near the truth."""
        self.extrinsic, self.pairs = extrinsic, list[Pair]()
        self.camera: PinholeCamera | None = None

    def add(self, frame: Frame, following: Frame) -> None:
        """Add two successive frames, if the car moves between them and enough of the image can be tracked."""
        camera = frame.camera
        if self.camera is None:
            self.camera = camera
        if not (camera.is_like(self.camera) and following.camera.is_like(camera)):
            return
        motion = motion_between(frame.points, following.points)
        if motion is None or np.linalg.norm(motion[:3, 3]) < LEAST_MOTION_M:
            return
        points = visible(frame, self.extrinsic)
        if len(points) < NEIGHBOURS:
            return
        image, next_image = grey(frame), grey(following)
        pixels = corners(image)
        if not len(pixels):
            return
        expected = Problem([Pair(points, motion, pixels, pixels)], camera, self.extrinsic).predicted()
        known = np.isfinite(expected).all(axis=1)
        pixels, expected = pixels[known], expected[known]
        there, found = tracked(image, next_image, pixels, expected)
        if found.sum() >= FEWEST_TRACKS:
            self.pairs.append(Pair(points, motion, pixels[found], there[found]))


def motion_estimate(pairs: MotionPairs, extrinsic: Extrinsic) -> MotionEstimate | None:
    """The extrinsic that explains the motion of some pairs, near another one; None if they are too few."""
    if pairs.camera is None or len(pairs.pairs) < FEWEST_PAIRS:
        return None
    problem = Problem(pairs.pairs, pairs.camera, extrinsic)
    pose = problem.fit(POSE)
    focal, center, radial, equidistant = lenses = [problem.fit(one, pose) for one in LENSES]
    best = min(lenses, key=total)
    if total(best) < (1 - STUCK) * total(pose):  # perhaps only because the pose alone has not come as far
        pose = min(pose, problem.fit(POSE, pose, best.unknowns[:6]), key=total)
    used = np.isfinite(pose.costs)
    if used.sum() < FEWEST_PAIRS * FEWEST_TRACKS:
        return None
    lens = LensReading(
        cost=total(pose),
        focal_cost=total(focal),
        center_cost=total(center),
        radial_cost=total(radial),
        equidistant_cost=total(equidistant),
        focal=float(focal.unknowns[7]),
        right=float(center.unknowns[8]),
        down=float(center.unknowns[9]),
        radial=float(radial.unknowns[10]),
    )
    return MotionEstimate(
        pose_from_vector(pose.unknowns[:6]) @ extrinsic,
        WIDER * pose.covariance + np.diag(COMMON**2),
        frames=len(pairs.pairs),
        tracks=int(used.sum()),
        moved_m=float(np.sum([np.linalg.norm(pair.motion[:3, 3]) for pair in pairs.pairs])),
        error_px=float(np.median(pose.scale)),
        lens=lens,
    )


def visible(frame: Frame, extrinsic: Extrinsic) -> Floats:
    """The points ``[N, 3]`` of a scan that the image shows, or nearly, in the LiDAR's frame."""
    points = frame.points[:, :3].astype(np.float64)
    moved = np.asarray(transform_points(extrinsic, points), np.float64)
    at = seen(moved, frame.camera, np.zeros(4), equidistant=False)
    size = np.array([frame.camera.width, frame.camera.height])
    inside = ((at > -MARGIN_PX) & (at < size + MARGIN_PX)).all(axis=1)
    return points[inside & (moved[:, 2] > NEAREST_M)]


def grey(frame: Frame) -> NDArray[np.uint8]:
    """The image of a frame in grey, ``[H, W]``."""
    return np.asarray(cv2.cvtColor(frame.image, cv2.COLOR_RGB2GRAY), np.uint8)


def total(fit: Fit) -> float:
    """The cost of all tracks."""
    return float(np.nansum(fit.costs))
