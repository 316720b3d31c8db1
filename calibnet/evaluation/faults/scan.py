"""Faults of the scan."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calibnet.datasets.frame import Frame
from calibnet.datasets.frame import Sequence as FrameSequence
from calibnet.datasets.synthetic.sequence import SyntheticSequence
from calibnet.evaluation.faults.alteration import Alteration
from calibnet.geometry import invert, rotation_from_euler_xyz, transform, transform_points
from calibnet.geometry.types import Transform

BAND_DEG = 0.4
"""Height of the bands of elevation that are kept or dropped when a scan is thinned: about one ring of 64."""
AXIS_CONVENTIONS = {
    "x right, y forward, z up": np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
    "x right, y down, z forward": np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]]),
    "x backward, y right, z up": np.diag([-1.0, -1.0, 1.0]),
}
"""Axes of other software, and the rotations that give a scan (x forward, y left, z up) these axes."""


def with_positions(frame: Frame, positions: NDArray[np.floating]) -> Frame:
    """The frame with its points moved to ``positions``, ``[N, 3]``."""
    return replace(frame, points=np.column_stack([positions, frame.points[:, 3]]).astype(np.float32))


def thinned(share: int) -> Alteration:
    """Keep one of ``share`` bands of elevation, as a scanner with fewer beams would."""

    def alter(frame: Frame) -> Frame:
        elevation = np.degrees(np.arctan2(frame.points[:, 2], np.hypot(frame.points[:, 0], frame.points[:, 1])))
        return replace(frame, points=frame.points[elevation % (share * BAND_DEG) < BAND_DEG])

    return alter


def remounted(degrees: float, metres: float) -> Alteration:
    """Rotate the LiDAR about its upward axis and move it forward, and the true extrinsic with it."""
    delta = transform(rotation_from_euler_xyz([0.0, 0.0, np.radians(degrees)]), np.array([metres, 0.0, 0.0]))

    def alter(frame: Frame) -> Frame:
        moved = with_positions(frame, transform_points(delta, frame.points[:, :3].astype(np.float64)))
        return replace(moved, camera_from_lidar=frame.camera_from_lidar @ invert(delta))

    return alter


def half_missing(frame: Frame) -> Frame:
    """The frame without the points left of the camera's axis."""
    across = transform_points(frame.camera_from_lidar, frame.points[:, :3])[:, 0]
    return replace(frame, points=frame.points[across > 0])


def noisy(metres: float) -> Alteration:
    """Add Gaussian noise with this standard deviation to the range of each point."""

    def alter(frame: Frame) -> Frame:
        positions = frame.points[:, :3].astype(np.float64)
        distance = np.maximum(np.linalg.norm(positions, axis=1, keepdims=True), 1e-6)
        error = np.random.default_rng(frame.index).normal(0.0, metres, (len(positions), 1))
        return with_positions(frame, positions * (1 + error / distance))

    return alter


def scaled_scan(factor: float) -> Alteration:
    """The scan in another unit."""
    return lambda frame: with_positions(frame, frame.points[:, :3] * factor)


def turned(rotation: NDArray[np.float64]) -> Alteration:
    """The scan in other axes."""
    return lambda frame: with_positions(frame, frame.points[:, :3] @ rotation.T)


def flipped(axis: int) -> Alteration:
    """The scan with one axis reversed, so that its axes are left-handed."""
    sign = np.where(np.arange(3) == axis, -1.0, 1.0)
    return lambda frame: with_positions(frame, frame.points[:, :3] * sign)


def reflecting(change: Callable[[NDArray[np.float32]], NDArray[np.float32]]) -> Alteration:
    """The scan with other intensities."""

    def alter(frame: Frame) -> Frame:
        return replace(frame, points=np.column_stack([frame.points[:, :3], change(frame.points[:, 3])]))

    return alter


def glint(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Intensities scaled to a single reflection that is 200 times as bright."""
    faint = values / np.float32(200)
    faint[:1] = 1.0
    return faint


def scan_at(sequence: FrameSequence, position: int) -> Alteration:
    """The scan of another frame of the same drive."""
    return lambda frame: replace(frame, points=sequence[position].points)


def accumulated(sequence: SyntheticSequence, position: int, count: int) -> Alteration:
    """Join ``count`` scans around a position by the motion of the car."""
    first = min(max(0, position - count // 2), len(sequence) - count)

    def world_from_lidar(at: int) -> Transform:
        return sequence.world_from_vehicle(at) @ sequence.mount.vehicle_from_lidar

    def alter(frame: Frame) -> Frame:
        here = invert(world_from_lidar(position))
        parts = []
        for at in range(first, first + count):
            points = frame.points if at == position else sequence[at].points
            moved = transform_points(here @ world_from_lidar(at), points[:, :3])
            parts.append(np.column_stack([moved, points[:, 3]]))
        return replace(frame, points=np.concatenate(parts).astype(np.float32))

    return alter
