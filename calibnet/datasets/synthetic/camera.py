"""The camera: rays through pixels, their radiance, then exposure, noise, blur and gamma like a real camera's."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from calibnet.datasets.synthetic.mesh import Mesh
from calibnet.datasets.synthetic.shading import cast, radiance
from calibnet.datasets.synthetic.weather import Weather
from calibnet.geometry import PinholeCamera
from calibnet.geometry.types import Transform


@dataclass(frozen=True)
class Exposure:
    """The conversion of radiance into 8-bit values.

    Attributes:
        level: target of the mean linear brightness of the lower half of the image, 0..1.
        white: RGB factors of the white balance.
        gamma: exponent ``1 / gamma`` of the tone curve.
        contrast: factor on the distance from mid-grey.
        saturation: factor on the distance from grey; 0 removes all colour.
        vignetting: share of the light that is lost in the corners.
        noise: standard deviation, for values 0..1.
        blur: standard deviation of the lens blur, pixels.
        quality: JPEG quality, 0 for none.
    """

    level: float
    white: tuple[float, float, float]
    gamma: float
    contrast: float
    saturation: float
    vignetting: float
    noise: float
    blur: float
    quality: int


def sample_exposure(generator: Generator) -> Exposure:
    """Draw the exposure of a camera outdoors."""
    red, blue = np.exp(generator.normal(0.0, 0.06, 2))
    return Exposure(
        level=float(np.exp(generator.uniform(np.log(0.08), np.log(0.30)))),
        white=(float(red), 1.0, float(blue)),
        gamma=float(generator.uniform(1.8, 2.5)),
        contrast=float(generator.uniform(0.9, 1.3)),
        saturation=float(generator.uniform(0.4, 1.05)),
        vignetting=float(generator.uniform(0.0, 0.3)),
        noise=float(generator.uniform(0.0, 0.025)),
        blur=float(generator.uniform(0.3, 0.9)),
        quality=int(generator.integers(50, 96)) if generator.random() < 0.5 else 0,
    )


def sample_indoor_exposure(generator: Generator) -> Exposure:
    """Draw the exposure of a camera indoors: often far too dark or washed out, with more noise."""
    usual = sample_exposure(generator)
    level, noise = float(np.exp(generator.uniform(np.log(0.025), np.log(0.5)))), float(generator.uniform(0.0, 0.05))
    return replace(usual, level=level, noise=noise, contrast=float(generator.uniform(0.8, 1.7)))


def pixel_rays(camera: PinholeCamera) -> NDArray[np.float32]:
    """Unit directions ``[H * W, 3]`` through the pixel centres, in the camera frame."""
    (fx, fy), (cx, cy) = camera.focal, camera.center
    x = ((np.arange(camera.width) - cx) / fx).astype(np.float32)
    y = ((np.arange(camera.height) - cy) / fy).astype(np.float32)
    rays = np.empty((camera.height, camera.width, 3), dtype=np.float32)
    rays[..., 0], rays[..., 1], rays[..., 2] = x, y[:, None], 1.0
    rays /= np.sqrt(x**2 + y[:, None] ** 2 + 1.0)[..., None]
    return rays.reshape(-1, 3)


def photograph(
    caster: Any,
    mesh: Mesh,
    weather: Weather,
    camera: PinholeCamera,
    world_from_camera: Transform,
    exposure: Exposure,
    generator: Generator,
) -> NDArray[np.uint8]:
    """The image ``[H, W, 3]`` uint8 that a camera takes of a mesh.

    Args:
        caster: the ``RaycastingScene`` of ``mesh``.
        mesh: the world.
        weather: its light.
        camera: the intrinsics.
        world_from_camera: its pose, 4x4.
        exposure: the conversion to 8 bits.
        generator: draws the noise.
    """
    rays = pixel_rays(camera) @ world_from_camera[:3, :3].T.astype(np.float32)
    origin = world_from_camera[:3, 3].astype(np.float32)
    hits = cast(caster, origin, rays)
    linear = np.empty((len(rays), 3), dtype=np.float32)
    missed = np.ones(len(rays), dtype=bool)
    missed[hits.rays] = False
    linear[missed] = weather.sky(rays[missed])
    linear[hits.rays] = radiance(caster, mesh, weather, hits, origin, rays[hits.rays], 1.0 / camera.focal[0])
    return develop(linear.reshape(camera.height, camera.width, 3), exposure, generator)


def develop(linear: NDArray[np.float32], exposure: Exposure, generator: Generator) -> NDArray[np.uint8]:
    """Convert linear radiance ``[H, W, 3]`` to an 8-bit image ``[H, W, 3]``."""
    import cv2

    height, width = linear.shape[:2]
    image: NDArray[np.float32] = cv2.GaussianBlur(np.minimum(linear, 8.0), (0, 0), exposure.blur).astype(
        np.float32, copy=False
    )
    metered = float(np.minimum(image[height // 2 :], 2.0).mean())  # metered on the road, as in cars, not on the sky
    image *= np.float32(exposure.level / max(metered, 1e-3)) * np.asarray(exposure.white, dtype=np.float32)
    y, x = np.linspace(-1, 1, height, dtype=np.float32), np.linspace(-1, 1, width, dtype=np.float32)
    image *= (1.0 - exposure.vignetting * 0.5 * (y[:, None] ** 2 + x**2))[..., None]
    image = np.clip(image, 0.0, 1.0)
    image = np.asarray(cv2.pow(image, 1.0 / exposure.gamma), dtype=np.float32)
    grey = image.mean(axis=2, keepdims=True)
    image = grey + exposure.saturation * (image - grey)
    image = 0.5 + exposure.contrast * (image - 0.5)
    image += exposure.noise * generator.standard_normal(image.shape, dtype=np.float32)
    pixels = (255.0 * np.clip(image, 0.0, 1.0)).astype(np.uint8)
    if exposure.quality:
        data = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, exposure.quality])[1]
        pixels = np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR), dtype=np.uint8)
    return np.ascontiguousarray(pixels)
