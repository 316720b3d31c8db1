"""The random numbers of one augmented frame, which `augmentation` and `on_device` both apply.

Drawing is separate from applying, so that both implementations draw the same numbers.
"""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np

from calibnet.geometry import PinholeCamera, rotation_from_euler_xyz
from calibnet.geometry.types import Rotation, Vector3
from calibnet.training.augmentation_recipe import CameraRecipe, ImageRecipe, ScanRecipe

Generator = np.random.Generator


def mirrored(camera: PinholeCamera) -> PinholeCamera:
    """The mirrored camera: left and right swapped."""
    matrix = camera.matrix.copy()
    matrix[0, 2] = camera.width - 1 - matrix[0, 2]
    return PinholeCamera(camera.width, camera.height, matrix)


class View(NamedTuple):
    """A virtual camera: rotated, with another lens.

    Attributes:
        near: the frame's camera with its image resized; resizing averages pixels, which the warp does not.
        camera: the virtual camera, at the network's input size.
        turn: ``[3, 3]`` rotation of the virtual camera about its centre.
    """

    near: PinholeCamera
    camera: PinholeCamera
    turn: Rotation

    @classmethod
    def draw(
        cls,
        camera: PinholeCamera,
        height: int,
        width: int,
        generator: Generator,
        recipe: CameraRecipe,
        magnification: float = 1.0,
    ) -> Self:
        """Draw another camera of this input size that sees what ``camera`` saw; see `augmentation.augment`."""
        zoom = np.exp(generator.uniform(*np.log(recipe.zoom)))
        filling = max(width / camera.width, height / camera.height)
        # a magnified crop needs the pixels of the original image
        scale = filling * min(zoom * magnification, max(zoom, 1 / filling))
        near = camera.resized(round(camera.width * scale), round(camera.height * scale))
        slack_x, slack_y = width - near.width, height - near.height
        left = generator.uniform(min(slack_x, 0), max(slack_x, 0))
        top = generator.uniform(min(slack_y, 0), max(slack_y, 0))
        matrix = near.matrix.copy()
        matrix[0] *= generator.uniform(*recipe.stretch)
        matrix[:2, 2] += left, top
        turn = np.eye(3)
        if generator.random() < recipe.turned:
            angles = generator.normal(0.0, recipe.turn_deg).clip(-recipe.turn_most_deg, recipe.turn_most_deg)
            turn = rotation_from_euler_xyz(np.radians(angles))
        return cls(near, PinholeCamera(width, height, matrix), turn)


class Scanner(NamedTuple):
    """A virtual scanner: which points it keeps, and how it measures them. The defaults change nothing.

    Attributes:
        turn: ``[3, 3]`` rotation of the virtual scanner, by whose bands of elevation points are chosen.
        place: position of the virtual scanner, metres.
        band_rad: width of a band.
        period: one of this many neighbouring bands is kept.
        phase: which of them is kept.
        kept: share of the points that is kept at random.
        reach_m: points farther away than this are dropped.
        range_noise: relative standard deviation of a point's distance.
        response: factor on the intensity; 0 without intensity.
        gamma: exponent applied to the intensity.
    """

    turn: Rotation = np.eye(3)
    place: Vector3 = np.zeros(3)
    band_rad: float = 1.0
    period: int = 1
    phase: int = 0
    kept: float = 1.0
    reach_m: float = float("inf")
    range_noise: float = 0.0
    response: float = 1.0
    gamma: float = 1.0

    @classmethod
    def draw(cls, generator: Generator, recipe: ScanRecipe) -> Self:
        """Draw a scanner by the recipe."""
        scanner = cls(range_noise=recipe.range_noise)
        if generator.random() < recipe.banded:
            roll, pitch = np.radians(generator.normal(0.0, recipe.tilt_deg, 2))
            if generator.random() < recipe.upended:
                pitch += np.pi / 2
            period = int(generator.integers(*recipe.bands, endpoint=True))
            scanner = scanner._replace(
                turn=rotation_from_euler_xyz(np.array([roll, pitch, 0.0])),
                place=generator.normal(0.0, recipe.apart_m, 3),
                band_rad=float(np.radians(generator.uniform(*recipe.band_deg))),
                period=period,
                phase=int(generator.integers(period)),
            )
        if generator.random() < recipe.thinned:
            scanner = scanner._replace(kept=generator.uniform(*recipe.kept))
        if generator.random() < recipe.shortened:
            scanner = scanner._replace(reach_m=generator.uniform(*recipe.reach_m))
        if generator.random() < recipe.dark:
            return scanner._replace(response=0.0)
        return scanner._replace(
            response=generator.uniform(*recipe.response), gamma=generator.uniform(*recipe.response_gamma)
        )


class Exposure(NamedTuple):
    """Exposure, colours, blur and noise of an image with values in 0..1. The defaults change nothing.

    Attributes:
        grey: whether colours are removed.
        tint: factors on red, green and blue.
        gamma: exponent applied to all values.
        contrast: factor on the distance from 0.5.
        brightness: offset of all values.
        blur_px: standard deviation of the blur, pixels; 0 without.
        noise: standard deviation of the noise.
    """

    grey: bool = False
    tint: Vector3 = np.ones(3)
    gamma: float = 1.0
    contrast: float = 1.0
    brightness: float = 0.0
    blur_px: float = 0.0
    noise: float = 0.0

    @classmethod
    def draw(cls, generator: Generator, recipe: ImageRecipe) -> Self:
        """Draw an exposure by the recipe."""
        grey = bool(generator.random() < recipe.grey)
        tinted = not grey and generator.random() < recipe.tinted
        return cls(
            grey=grey,
            tint=generator.uniform(*recipe.tint, 3) if tinted else np.ones(3),
            gamma=float(np.exp(generator.uniform(*recipe.log_gamma))),
            contrast=generator.uniform(*recipe.contrast),
            brightness=generator.uniform(*recipe.brightness),
            blur_px=generator.uniform(*recipe.blur_px) if generator.random() < recipe.blurred else 0.0,
            noise=generator.uniform(*recipe.noise) if generator.random() < recipe.noisy else 0.0,
        )
