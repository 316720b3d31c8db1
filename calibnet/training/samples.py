"""Training samples: a frame, a drawn miscalibration, the network's input and the truth."""

from __future__ import annotations

from collections.abc import Sequence as Many
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch.utils.data import Dataset

from calibnet.datasets.frame import Frame, Sequence
from calibnet.errors import DatasetError
from calibnet.geometry import (
    MiscalibrationRange,
    PinholeCamera,
    invert,
    project,
    scaled,
    transform_points,
)
from calibnet.geometry.projection import nearest_per_cell
from calibnet.geometry.types import Extrinsic, Floats, Transform
from calibnet.network.batch import Cut, LidarInput, NetworkInputs, lidar_input, make_batch
from calibnet.training.augmentation import augment
from calibnet.training.draws import draws_of
from calibnet.training.losses import Target

FEWEST_VISIBLE_CELLS = 40
"""Cells with a point below which a sample teaches nothing and another is drawn."""


@dataclass(frozen=True)
class Sample:
    """One sample as arrays; `collate` makes a batch of them."""

    image: NDArray[np.uint8]
    lidar: LidarInput
    intrinsics: NDArray[np.float32]
    correction: NDArray[np.float32]
    shift: NDArray[np.float32]
    visible: list[NDArray[np.bool_]]


def visible_cells(lidar: LidarInput, points: NDArray[np.float32], reference: Extrinsic,
                  camera: PinholeCamera, correction: Transform) -> list[NDArray[np.bool_]]:  # fmt: skip
    """Per scale ``[h, w]``: does the camera, truly placed, see the cell's point?

    A point is taken as hidden when another one within 4 px is clearly nearer: the scanner looks over
    what the camera has in front of it.
    """
    truth = project(points, reference, camera)
    nearest = nearest_per_cell(truth, camera, 4)
    front = np.append(truth.depth, np.float32(np.inf))[nearest]  # empty cells pick the last, -1
    masks = []
    for cells in lidar.cells:
        flat = cells.reshape(3, -1).T
        moved = transform_points(correction, flat)
        depth = np.maximum(moved[:, 2], 0.1)
        u = camera.matrix[0, 0] * moved[:, 0] / depth + camera.matrix[0, 2]
        v = camera.matrix[1, 1] * moved[:, 1] / depth + camera.matrix[1, 2]
        inside = (flat[:, 2] > 0) & (u > 0) & (u < camera.width - 1) & (v > 0) & (v < camera.height - 1)
        column = np.clip((u + 0.5) / 4, 0, front.shape[1] - 1).astype(int)
        row = np.clip((v + 0.5) / 4, 0, front.shape[0] - 1).astype(int)
        seen = depth < 1.2 * front[row, column] + 1.0
        masks.append((inside & seen).reshape(cells.shape[1:]))
    return masks


def make_sample(
    frame: Frame,
    delta: Transform,
    scales: tuple[int, ...],
    shift: Floats | tuple[float, float] = (0.0, 0.0),
) -> Sample:
    """The sample of a frame, already at input size, under ``delta @ camera_from_lidar``.

    ``shift`` displaces the LiDAR image by so many pixels ``(x, y)``: only where features train alone,
    since no pose explains it.
    """
    displaced = frame.camera.matrix.copy()
    displaced[:2, 2] += shift
    camera = PinholeCamera(frame.camera.width, frame.camera.height, displaced)
    lidar = lidar_input(frame.points, delta @ frame.camera_from_lidar, camera, scales)
    correction = invert(delta)
    visible = visible_cells(lidar, frame.points, frame.camera_from_lidar, frame.camera, correction)
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
    return inputs, Target(
        stack([sample.correction for sample in samples]),
        stack([sample.shift for sample in samples]),
        [stack([cut.apply(mask) for mask in scale]) for scale in visible],
    )


@dataclass(frozen=True)
class Source:
    """A sequence and how often it is drawn, relative to the other sources."""

    sequence: Sequence
    weight: float


class TrainingSamples(Dataset[Sample]):
    """An endless, random and repeatable stream: sample ``n`` depends on the seed and on ``n`` alone.

    Frames are kept in memory once read: the real ones are few. The input size is drawn once per
    batch, so that lenses and aspect ratios vary while a batch stays one tensor.
    """

    SHAPES = ((160, 512), (192, 448), (224, 384))
    SHAPE_PROBABILITY = (0.5, 0.2, 0.3)
    ATTEMPTS = 100
    EASIEST = 0.5  # strength of augmentation that the warm-up starts with
    OWN_SHARE = 0.4  # where there are none before: only what a stage's own first look leaves
    RESIDUAL_STRETCH = (0.7, 1.8)  # times as large as measured: frames never trained on leave more behind
    WARM_UP_SHIFT = 40.0  # pixels in x and y by which the warm-up displaces the LiDAR image at most
    SHIFT = 24.0  # the same later on, in every batch that trains features alone
    FEATURES_EVERY = 3  # of so many batches after the warm-up, one trains features alone; 0: none does

    def __init__(
        self,
        sources: Many[Source],
        range_: MiscalibrationRange,
        scales: tuple[int, ...],
        area: float,
        batch: int,
        seed: int,
        warm_up: int = 0,
        magnification: float = 1.0,
    ) -> None:
        """A stream whose first ``warm_up`` samples are for the features alone.

        They start with fewer of the odd scans and pictures, and their LiDAR images are displaced at random; so are
        those of every third batch after them. Miscalibrations scatter around none, so "the match is where the cell is"
        is a good guess that features pick up, from the image's borders and on the ground near the car, and then stay
        with; the displacement makes it a bad one.

        A stage whose image is larger than ``area`` by the square of ``magnification`` is trained on cuttings of it.
        """
        self.sources, self.range, self.scales = list(sources), range_, scales
        self.batch, self.seed, self.warm_up, self.magnification = batch, seed, warm_up, magnification
        weights = np.array([source.weight for source in sources], dtype=np.float64)
        self.probability = weights / weights.sum()
        factor = (area / (160 * 512)) ** 0.5
        self.shapes = [(round(h * factor / 32) * 32, round(w * factor / 32) * 32) for h, w in self.SHAPES]
        self.residuals: list[Transform] = []
        self.features_every = self.FEATURES_EVERY
        self.draws = draws_of(range_)
        self.residual_share = self.draws.residual_share
        self.cache: dict[tuple[int, int], Frame] = {}

    def read(self, source: int, position: int) -> Frame:
        """One frame, from memory if it was read before; a sequence may keep its own cache instead."""
        sequence = self.sources[source].sequence
        if getattr(sequence, "caches", False):
            return sequence[position]
        if (source, position) not in self.cache:
            self.cache[source, position] = sequence[position]
        return self.cache[source, position]

    def strength(self, number: int) -> float:
        """How varied sample ``number`` may be, 0..1."""
        return max(self.EASIEST, min(1.0, number / self.warm_up)) if self.warm_up else 1.0

    def shape(self, number: int) -> tuple[int, int]:
        """Height and width of sample ``number``: its batch's."""
        generator = np.random.default_rng([self.seed, 1, number // self.batch])
        return self.shapes[generator.choice(len(self.shapes), p=self.SHAPE_PROBABILITY)]

    def __getitem__(self, number: int) -> Sample:
        """Draw sample ``number``."""
        strength = self.strength(number)
        generator = np.random.default_rng([self.seed, 2, number])
        for _ in range(self.ATTEMPTS):
            frame = self.draw_frame(number, generator, strength)
            largest = self.largest_shift(number)
            shift = generator.uniform(-largest, largest, 2)
            sample = make_sample(frame, self.draw(generator), self.scales, shift)
            if sample.visible[0].sum() >= FEWEST_VISIBLE_CELLS:
                return sample
        raise DatasetError(
            f"None of {self.ATTEMPTS} draws gave {FEWEST_VISIBLE_CELLS} cells with a visible LiDAR point, the last one "
            f"from {frame.source}; check that the training data's calibration fits its scans."
        )

    def largest_shift(self, number: int) -> float:
        """Pixels by which the LiDAR image of a sample is displaced at most: 0 but where features train alone."""
        if number < self.warm_up:
            return self.WARM_UP_SHIFT
        every = self.features_every
        return self.SHIFT if every and number // self.batch % every == every - 1 else 0.0

    def draw_frame(self, number: int, generator: np.random.Generator, strength: float, whole: bool = False) -> Frame:
        """An augmented frame at the size of sample ``number``; ``whole`` keeps the magnification out of it."""
        source = self.draw_source(generator, strength)
        frame = self.read(source, int(generator.integers(len(self.sources[source].sequence))))
        magnification = 1.0 if whole else self.magnification
        return augment(frame, *self.shape(number), generator, strength, magnification)

    def draw_source(self, generator: np.random.Generator, strength: float) -> int:
        """A source by its weight; the synthetic world, whose rigs differ most, only comes in with the strength."""
        while True:
            source = int(generator.choice(len(self.sources), p=self.probability))
            synthetic = getattr(self.sources[source].sequence, "caches", False) and len(self.sources) > 1
            if not synthetic or generator.random() < strength:
                return source

    def draw(self, generator: np.random.Generator) -> Transform:
        """A miscalibration as `Draws` has them, or as the looks before leave behind."""
        if self.residuals and generator.random() < self.residual_share:
            residual = self.residuals[generator.integers(len(self.residuals))]
            return scaled(residual, generator.uniform(*self.RESIDUAL_STRETCH))
        return self.draws.uniform(generator)
