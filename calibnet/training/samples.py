"""Training samples: the network's input for a frame under a random miscalibration, and the ground truth."""

from __future__ import annotations

from collections.abc import Sequence as Many
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch.utils.data import Dataset

from calibnet.datasets.frame import Frame
from calibnet.errors import DatasetError
from calibnet.geometry import PinholeCamera, invert, project, transform_points
from calibnet.geometry.projection import nearest_per_cell
from calibnet.geometry.types import Extrinsic, Floats, Transform
from calibnet.network.batch import Cut, LidarInput, NetworkInputs, lidar_input, make_batch
from calibnet.network.pose import DEPTH_FLOOR
from calibnet.network.target import Target
from calibnet.training.draws import Draws
from calibnet.training.frames import TrainingFrames
from calibnet.training.recipe import SampleRecipe


@dataclass(frozen=True)
class Sample:
    """One sample as arrays; `collate` makes a batch of them."""

    image: NDArray[np.uint8]
    lidar: LidarInput
    intrinsics: NDArray[np.float32]
    correction: NDArray[np.float32]
    shift: NDArray[np.float32]
    visible: list[NDArray[np.bool_]]


def visible_cells(
    lidar: LidarInput,
    points: NDArray[np.float32],
    reference: Extrinsic,
    camera: PinholeCamera,
    correction: Transform,
    recipe: SampleRecipe,
) -> list[NDArray[np.bool_]]:
    """Per scale ``[h, w]``: whether the camera sees the cell's point under the true extrinsic.

    A point counts as hidden if another one within the same few pixels is clearly nearer: a scanner mounted higher sees
    over objects that block the camera's view.
    """
    truth = project(points, reference, camera)
    nearest = nearest_per_cell(truth, camera, recipe.hiding_px)
    front = np.append(truth.depth, np.float32(np.inf))[nearest]  # empty cells pick the last, -1
    masks = []
    for cells in lidar.cells:
        flat = cells.reshape(3, -1).T
        moved = transform_points(correction, flat)
        depth = np.maximum(moved[:, 2], DEPTH_FLOOR)
        u = camera.matrix[0, 0] * moved[:, 0] / depth + camera.matrix[0, 2]
        v = camera.matrix[1, 1] * moved[:, 1] / depth + camera.matrix[1, 2]
        inside = (flat[:, 2] > 0) & (u > 0) & (u < camera.width - 1) & (v > 0) & (v < camera.height - 1)
        column = np.clip((u + 0.5) / recipe.hiding_px, 0, front.shape[1] - 1).astype(int)
        row = np.clip((v + 0.5) / recipe.hiding_px, 0, front.shape[0] - 1).astype(int)
        seen = depth < recipe.hidden_factor * front[row, column] + recipe.hidden_margin_m
        masks.append((inside & seen).reshape(cells.shape[1:]))
    return masks


def make_sample(
    frame: Frame,
    delta: Transform,
    scales: tuple[int, ...],
    recipe: SampleRecipe,
    shift: Floats | tuple[float, float] = (0.0, 0.0),
) -> Sample:
    """The sample of a frame, already at input size, under ``delta @ camera_from_lidar``.

    ``shift`` displaces the LiDAR image by ``(x, y)`` pixels. Only batches that train features alone use it, since no
    pose explains it.
    """
    displaced = frame.camera.matrix.copy()
    displaced[:2, 2] += shift
    camera = PinholeCamera(frame.camera.width, frame.camera.height, displaced)
    lidar = lidar_input(frame.points, delta @ frame.camera_from_lidar, camera, scales)
    correction = invert(delta)
    visible = visible_cells(lidar, frame.points, frame.camera_from_lidar, frame.camera, correction, recipe)
    return Sample(
        frame.image,
        lidar,
        frame.camera.matrix.astype(np.float32),
        correction.astype(np.float32),
        np.asarray(shift, np.float32),
        visible,
    )


def collate(samples: Many[Sample]) -> tuple[NetworkInputs, Target]:
    """Stack samples of one input size."""
    scans = [sample.lidar for sample in samples]
    cut = Cut.of(scans)

    def stack(arrays: Many[NDArray[np.generic]]) -> torch.Tensor:
        return torch.from_numpy(np.stack(arrays))

    image = stack([sample.image for sample in samples]).permute(0, 3, 1, 2)
    inputs = make_batch(image, scans, [sample.intrinsics for sample in samples], cut)
    visible = zip(*(sample.visible for sample in samples), strict=True)
    shift = stack([sample.shift for sample in samples])
    return inputs, Target(
        stack([sample.correction for sample in samples]),
        shift,
        [stack([cut.apply(mask) for mask in scale]) for scale in visible],
        bool(shift.any()),
    )


class SampleNumbers:
    """The properties of a sample that depend on its number; everything else about a sample is random."""

    def __init__(self, frames: TrainingFrames, draws: Draws, scales: tuple[int, ...]) -> None:
        """Samples of ``frames`` under miscalibrations of ``draws``; ``scales`` are the strides of the cells."""
        self.frames, self.draws, self.scales = frames, draws, scales
        self.recipe, self.features = frames.recipe.sample, frames.recipe.features

    def variety(self, number: int) -> float:
        """Variety of sample ``number``, 0..1, which grows during the warm-up; see `TrainingFrames.draw`."""
        warm_up = self.features.warm_up
        return max(self.features.warm_up_variety, min(1.0, number / warm_up)) if warm_up else 1.0

    def largest_shift(self, number: int) -> float:
        """Largest displacement of the LiDAR image of a sample, pixels; 0 unless its batch trains features alone."""
        if number < self.features.warm_up:
            return self.features.warm_up_shift_px
        every = self.features.every
        return self.features.shift_px if every and number // self.frames.batch % every == every - 1 else 0.0

    def too_few(self, source: str) -> DatasetError:
        """The error for when no draw shows enough points; ``source`` names the last frame."""
        return DatasetError(
            f"None of {self.recipe.attempts} draws gave {self.recipe.fewest_visible_cells} cells with a visible LiDAR "
            f"point, the last one from {source}; check that the training data's calibration fits its scans."
        )


class TrainingSamples(SampleNumbers, Dataset[Sample]):
    """An endless, random and repeatable stream: sample ``n`` depends only on the frames' seed and on ``n``."""

    def __getitem__(self, number: int) -> Sample:
        """Draw sample ``number``."""
        generator = np.random.default_rng([self.frames.seed, 2, number])
        largest = self.largest_shift(number)
        for _ in range(self.recipe.attempts):
            frame = self.frames.draw(number, generator, self.variety(number))
            shift = generator.uniform(-largest, largest, 2)
            sample = make_sample(frame, self.draws.draw(generator), self.scales, self.recipe, shift)
            if sample.visible[0].sum() >= self.recipe.fewest_visible_cells:
                return sample
        raise self.too_few(frame.source)
