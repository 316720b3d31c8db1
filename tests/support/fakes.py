"""A frame and a cascade without data sets, weights or torch: small, seeded and self-consistent.

The volumes peak where the points truly belong and every stage leaves a third of the error, so that
tests and images show what a working cascade would.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from calibnet.datasets.frame import Frame
from calibnet.geometry import (
    RANGES,
    MiscalibrationRange,
    PinholeCamera,
    euler_xyz,
    invert,
    miscalibration,
    project,
    rotation_from_euler_xyz,
    transform,
)
from calibnet.geometry.projection import nearest_per_cell
from calibnet.trace import CascadeTrace, DriveEstimate, Estimate, ScaleTrace, StageDetail, StageTrace
from calibnet.verdict import Cause
from tests.support.judged import judged

LEFTOVER = 0.3
MATCH_ERROR_LIMIT = 4.0
DELTA = miscalibration([2.0, -3.0, 4.0], [0.2, -0.3, 0.1])
AXES_CAMERA_FROM_LIDAR = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
REFERENCE = transform(AXES_CAMERA_FROM_LIDAR, [0.06, -0.08, -0.27])


def make_frame(index: int = 0, width: int = 400, height: int = 120, points: int = 6000) -> Frame:
    """A wall, a road and a smooth image."""
    generator = np.random.default_rng(index)
    matrix = np.array([[0.58 * width, 0.0, width / 2], [0.0, 0.58 * width, height / 2], [0.0, 0.0, 1.0]])
    azimuth = generator.uniform(-0.9, 0.9, points)
    elevation = generator.uniform(-0.35, 0.05, points)
    distance = np.minimum(1.7 / np.maximum(-np.sin(elevation), 1e-3), 15.0 + 10.0 * (np.sin(9.0 * azimuth) > 0))
    xyz = distance[:, None] * np.stack(
        [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], axis=1
    )
    scan = np.concatenate([xyz, generator.uniform(size=(points, 1))], axis=1).astype(np.float32)
    v, u = np.mgrid[:height, :width]
    image = np.stack([u * 255 // width, v * 255 // height, np.full_like(u, 40 * (index % 6))], axis=-1)
    camera = PinholeCamera(width, height, matrix)
    return Frame(index, 0.1 * index, image.astype(np.uint8), scan, camera, REFERENCE, f"fake {index}")


@dataclass(frozen=True)
class SkippedStage:
    number: int
    range: MiscalibrationRange
    reason: str


@dataclass(frozen=True)
class FakeStage:
    number: int


class FakeSequence:
    """Frames numbered ``first``, ``first + 1`` and so on."""

    name = "fake/00"
    rig = "a fake car"

    def __init__(self, length: int = 3, first: int = 0) -> None:
        self._length, self._first = length, first

    def __len__(self) -> int:
        return self._length

    def __getitem__(self, position: int) -> Frame:
        return make_frame(self._first + position)


class FakeCascade:
    """Moves to the dataset's extrinsic, leaving `LEFTOVER` of the error at every stage."""

    skipped: ClassVar = [SkippedStage(2, RANGES[1], "Stage 2 (±10°/1 m) has no weights: train it.")]
    unjudged = ""

    def __init__(
        self,
        stages: tuple[int, ...] = (3, 4, 5),
        strides: tuple[int, ...] = (8, 16, 32),
        radius: int = 4,
        size: tuple[int, int] = (512, 160),
        doubted: tuple[int, ...] = (),
        unsure: tuple[int, ...] = (),
        causes: tuple[Cause, ...] = (),
    ) -> None:
        """Frames whose index is in ``doubted`` are rejected for ``causes``; of those in ``unsure`` nobody can tell."""
        self.doubted, self.unsure, self.causes = doubted, unsure, causes
        self.stages = [FakeStage(number) for number in stages]
        self.strides, self.radius, self.size = strides, radius, size

    @property
    def numbers(self) -> tuple[int, ...]:
        return tuple(stage.number for stage in self.stages)

    def only(self, number: int) -> FakeCascade:
        return FakeCascade((number,), self.strides, self.radius, self.size)

    def calibrate(self, frame: Frame, initial: NDArray[np.float64], detail: bool = True) -> CascadeTrace:
        """A trace whose every array has the shape and meaning of the contract."""
        camera = frame.camera.resized(*self.size)
        stages = []
        current = initial
        for stage in self.stages:
            number = stage.number
            before, current = current, _towards(current, frame.camera_from_lidar, LEFTOVER)
            details = self._detail(frame, camera, before, number) if detail else None
            correction = current @ invert(before)
            timing = {"projection": float(np.random.default_rng().uniform(1, 3))}
            range_, off = RANGES[number - 1], 6.0 if frame.index in self.doubted else 2.0
            stages.append(StageTrace(number, range_, camera, before, current, correction, timing, None, details, off))
        trace = CascadeTrace(initial, tuple(stages), {"features": 3.0}, match_error_limit_px=MATCH_ERROR_LIMIT)
        rejected = frame.index in self.doubted
        return judged(trace, rejected, self.causes if rejected else (), frame.index in self.unsure)

    def calibrate_drive(
        self, frames: Any, initial: NDArray[np.float64], observer: Callable[[int, int], None] | None = None
    ) -> DriveEstimate:
        """A tenth of a degree of yaw off the first frame's extrinsic."""
        for number in range(len(frames)):
            if observer is not None:
                observer(number, len(frames))
        found = miscalibration([0, 0, 0.1], [0, 0, 0]) @ frames[0].camera_from_lidar
        history = tuple(
            (frames[position].index, Estimate(found, 1e-4 * np.eye(6), 1 + position)) for position in range(len(frames))
        )
        return DriveEstimate(found, 1e-4 * np.eye(6), len(frames), history)

    def _detail(self, frame: Frame, camera: PinholeCamera, before: NDArray[np.float64], seed: int) -> StageDetail:
        projection = project(frame.points, before, camera)
        truth = frame.points[projection.index, :3] @ frame.camera_from_lidar[:3, :3].T
        truth = (truth + frame.camera_from_lidar[:3, 3]) @ camera.matrix.T
        moved = (truth[:, :2] / truth[:, 2:] - projection.pixels).astype(np.float32)
        generator = np.random.default_rng(seed)
        scales = []
        for stride in self.strides:
            winner = nearest_per_cell(projection, camera, stride)
            field = np.where((winner >= 0)[..., None], moved[winner], 0.0)
            scales.append(self._scale(field, winner >= 0, stride, generator))
        winner = nearest_per_cell(projection, camera, self.strides[0])
        field = np.where((winner >= 0)[..., None], moved[winner], 0.0).astype(np.float32)
        confidence = np.where(winner >= 0, generator.uniform(0.2, 1.0, winner.shape), 0.0).astype(np.float32)
        depth = np.append(projection.depth, np.float32(0.0))[nearest_per_cell(projection, camera)]
        return StageDetail(depth, tuple(scales), field, confidence)

    def _scale(
        self, field: NDArray[np.float32], occupied: NDArray[np.bool_], stride: int, generator: np.random.Generator
    ) -> ScaleTrace:
        offsets = np.arange(-self.radius, self.radius + 1)
        dy, dx = np.meshgrid(offsets, offsets, indexing="ij")
        cells = field / stride
        squared = (dx[..., None, None] - cells[..., 0]) ** 2 + (dy[..., None, None] - cells[..., 1]) ** 2
        volume = np.exp(-0.4 * squared) - 0.1 + generator.normal(0.0, 0.08, squared.shape)
        weights = np.exp(volume / 0.07)
        probability = weights / weights.sum(axis=(0, 1))
        flat = probability.reshape(-1, *occupied.shape).argmax(axis=0)
        best = np.stack([dx.reshape(-1)[flat], dy.reshape(-1)[flat]], axis=-1).astype(np.int64)
        shape = (20, *occupied.shape)
        smooth = field.sum(axis=-1) / stride
        return ScaleTrace(
            stride,
            volume.astype(np.float16),
            probability.astype(np.float16),
            best,
            (smooth + generator.normal(0.0, 1.0, shape)).astype(np.float16),
            (smooth * generator.uniform(-1, 1, (20, 1, 1))).astype(np.float16),
            occupied,
        )


def _towards(estimate: NDArray[np.float64], target: NDArray[np.float64], leftover: float) -> NDArray[np.float64]:
    error = estimate @ invert(target)
    angles = leftover * euler_xyz(error[:3, :3])
    return transform(rotation_from_euler_xyz(angles), leftover * error[:3, 3]) @ target
