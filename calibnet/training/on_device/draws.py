"""Draws the random numbers of a batch on the host: all but the noise of single points and pixels.

They are drawn sample by sample with the generators and functions of `calibnet.training.samples`: hundreds of numbers
per sample, which other processes can draw while the device computes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np
import torch
from torch import Tensor
from torch.utils.data import Dataset

from calibnet.geometry import PinholeCamera, invert, transform
from calibnet.geometry.types import Extrinsic, Floats, Transform
from calibnet.training.augmentation_draws import Exposure, Scanner, View, mirrored
from calibnet.training.samples import SampleNumbers

MIRROR_CAMERA, MIRROR_LIDAR = np.diag([-1.0, 1, 1, 1]), np.diag([1.0, -1, 1])
"""The reflections of the camera's frame, 4x4, and of the scanner's axes, 3x3."""


class Scanners(NamedTuple):
    """`calibnet.training.augmentation_draws.Scanner` of a batch: ``[B, 3, 3]``, ``[B, 3]`` and ``[B]`` float32."""

    turn: Tensor
    place: Tensor
    band_rad: Tensor
    period: Tensor
    phase: Tensor
    kept: Tensor
    reach_m: Tensor
    range_noise: Tensor
    response: Tensor
    gamma: Tensor

    @classmethod
    def of(cls, scanners: Sequence[Scanner]) -> Self:
        """Stack the scanners of a batch."""
        return cls(*(single(column) for column in zip(*scanners, strict=True)))


class Exposures(NamedTuple):
    """`calibnet.training.augmentation_draws.Exposure` of a batch: ``[B]``, the tint ``[B, 3]``.

    Attributes:
        blurred: indices of the images that are blurred.
        blur_px: standard deviation of their blur, for these images alone.
    """

    grey: Tensor
    tint: Tensor
    gamma: Tensor
    contrast: Tensor
    brightness: Tensor
    noise: Tensor
    blurred: Tensor
    blur_px: Tensor

    @classmethod
    def of(cls, exposures: Sequence[Exposure]) -> Self:
        """Stack the exposures of a batch."""
        all_of = Exposure(*(np.stack(column) for column in zip(*exposures, strict=True)))  # type: ignore[arg-type]
        blurred = np.flatnonzero(all_of.blur_px)
        return cls(
            grey=torch.from_numpy(all_of.grey),
            tint=single(all_of.tint),
            gamma=single(all_of.gamma),
            contrast=single(all_of.contrast),
            brightness=single(all_of.brightness),
            noise=single(all_of.noise),
            blurred=torch.from_numpy(blurred),
            blur_px=single(np.asarray(all_of.blur_px)[blurred]),
        )


def single(values: object) -> Tensor:
    """A float32 tensor of numbers in any precision."""
    return torch.from_numpy(np.asarray(values, dtype=np.float32))


@dataclass(frozen=True, eq=False)
class Draw:
    """The random numbers of one sample.

    Attributes:
        number: number of the sample.
        frame: number of its frame in the store.
        size: width and height of the frame's image.
        reflected: whether the frame is mirrored.
        view: the virtual camera.
        reference: 4x4, true extrinsic of the virtual camera for the points as stored, the mirror included.
        scanner: the virtual scanner.
        exposure: exposure of the image.
        delta: the miscalibration, 4x4.
        shift: ``[2]`` pixels by which the LiDAR image is displaced in addition.
    """

    number: int
    frame: int
    size: tuple[int, int]
    reflected: bool
    view: View
    reference: Transform
    scanner: Scanner
    exposure: Exposure
    delta: Transform
    shift: Floats

    @classmethod
    def of(
        cls,
        frame: int,
        camera: PinholeCamera,
        extrinsic: Extrinsic,
        samples: SampleNumbers,
        number: int,
        generator: np.random.Generator,
    ) -> Self:
        """Draw the numbers of sample ``number`` of a frame, as `calibnet.training.augmentation.augment` does."""
        recipe, variety, size = samples.frames.recipe, samples.variety(number), (camera.width, camera.height)
        reflected = bool(generator.random() < recipe.camera.mirrored)
        scanner, exposure = Scanner(), Exposure()
        if reflected:
            camera, extrinsic = mirrored(camera), MIRROR_CAMERA @ extrinsic
        input_size, magnification = samples.frames.size(number), samples.frames.magnification
        view = View.draw(camera, *input_size, generator, recipe.camera, magnification)
        if generator.random() < variety:
            scanner = Scanner.draw(generator, recipe.scan)
        if generator.random() < variety:
            exposure = Exposure.draw(generator, recipe.picture)
        if reflected:  # the scanner is drawn for the mirrored points
            scanner = scanner._replace(turn=scanner.turn @ MIRROR_LIDAR, place=MIRROR_LIDAR @ scanner.place)
        reference = transform(view.turn, np.zeros(3)) @ extrinsic
        largest = samples.largest_shift(number)
        shift = generator.uniform(-largest, largest, 2)
        delta = samples.draws.draw(generator)
        return cls(number, frame, size, reflected, view, reference, scanner, exposure, delta, shift)

    @property
    def to_image(self) -> Floats:
        """``[3, 3]`` homography from pixels of the input to pixels of the stored image."""
        near, camera, turn = self.view
        width, height = self.size
        sx, sy = width / near.width, height / near.height
        enlarged = np.array([[sx, 0, 0.5 * sx - 0.5], [0, sy, 0.5 * sy - 0.5], [0, 0, 1]])
        homography: Floats = enlarged @ near.matrix @ turn.T @ np.linalg.inv(camera.matrix)
        if self.reflected:
            homography[0] = (width - 1) * homography[2] - homography[0]
        return homography


class DrawnBatch(NamedTuple):
    """The random numbers of a batch; tensors are float32 unless another type is given.

    Attributes:
        size: height and width of the input.
        most_points: number of points of the largest scan.
        most_shrunk: the largest of ``shrinking``.
        of_features: whether the batch trains features alone.
        seed: seed of the noise of points and pixels.
        frames: ``[B]`` int64, numbers of the frames in the store.
        to_image: ``[B, 3, 3]`` homographies from pixels of the input to pixels of the stored images.
        shrinking: ``[B]`` pixels of the stored image per pixel of the input.
        reference: ``[B, 4, 4]`` true camera_from_lidar.
        initial: ``[B, 4, 4]`` miscalibrated camera_from_lidar.
        correction: ``[B, 4, 4]``, ``reference = correction @ initial``.
        intrinsics: ``[B, 3, 3]``.
        shift: ``[B, 2]`` pixels by which the LiDAR image is displaced in addition.
        scanners: the virtual scanners.
        exposures: the exposures of the images.
    """

    size: tuple[int, int]
    most_points: int
    most_shrunk: float
    of_features: bool
    seed: int
    frames: Tensor
    to_image: Tensor
    shrinking: Tensor
    reference: Tensor
    initial: Tensor
    correction: Tensor
    intrinsics: Tensor
    shift: Tensor
    scanners: Scanners
    exposures: Exposures


class DrawnSamples(Dataset[Draw]):
    """The random numbers of an endless stream of samples; each depends only on the seed and the sample's number."""

    def __init__(
        self,
        samples: SampleNumbers,
        cameras: Sequence[PinholeCamera],
        extrinsics: Sequence[Extrinsic],
        points: Sequence[int],
        first: Sequence[int],
    ) -> None:
        """Draw for frames with these cameras, extrinsics and numbers of points; ``first`` of each source."""
        self.samples, self.cameras, self.extrinsics = samples, list(cameras), list(extrinsics)
        self.points, self.first = list(points), list(first)

    def __getitem__(self, number: int) -> Draw:
        """Draw sample ``number``."""
        frames = self.samples.frames
        generator = np.random.default_rng([frames.seed, 2, number])
        source = frames.draw_source(generator, self.samples.variety(number))
        frame = self.first[source] + int(generator.integers(len(frames.sources[source].sequence)))
        return Draw.of(frame, self.cameras[frame], self.extrinsics[frame], self.samples, number, generator)

    def collate(self, draws: Sequence[Draw]) -> DrawnBatch:
        """Collate draws of one input size."""
        frames = np.array([draw.frame for draw in draws])
        reference = np.stack([draw.reference for draw in draws])
        delta = np.stack([draw.delta for draw in draws])
        camera = draws[0].view.camera
        shrinking = np.array([draw.size[0] / draw.view.near.width for draw in draws])
        shift = single([draw.shift for draw in draws])
        return DrawnBatch(
            (camera.height, camera.width),
            max(self.points[frame] for frame in frames),
            float(shrinking.max()),
            bool(shift.any()),
            int(np.random.SeedSequence([self.samples.frames.seed, 5, draws[0].number]).generate_state(1)[0]),
            torch.from_numpy(frames),
            single([draw.to_image for draw in draws]),
            single(shrinking),
            single(reference),
            single(delta @ reference),
            single([invert(of) for of in delta]),
            single([draw.view.camera.matrix for draw in draws]),
            shift,
            Scanners.of([draw.scanner for draw in draws]),
            Exposures.of([draw.exposure for draw in draws]),
        )
