"""Sun, sky and haze of a scene."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from calibnet.datasets.synthetic.drawing import TILE
from calibnet.datasets.synthetic.textures import turbulence

Array = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Weather:
    """Light of a scene, in linear RGB.

    Attributes:
        sun_direction: ``[3]`` unit vector towards the sun.
        sun: ``[3]`` its irradiance; zero when overcast.
        zenith, horizon: ``[3]`` sky colours.
        ambient: ``[3]`` light from the whole sky on a level surface.
        bounce: ``[3]`` light from the ground.
        clouds: 0 clear to 1 overcast.
        cloud_shift: ``[2]`` position of the sky in the cloud texture.
        visibility: distance at which haze dominates, metres.
    """

    sun_direction: Array = field(repr=False)
    sun: Array
    zenith: Array
    horizon: Array
    ambient: Array
    bounce: Array
    clouds: float
    cloud_shift: Array
    visibility: float

    def sky(self, direction: Array) -> Array:
        """Radiance ``[N, 3]`` of the sky in unit directions ``[N, 3]``."""
        up = np.maximum(direction[:, 2:], 0.0)
        colour = self.horizon + (self.zenith - self.horizon) * np.sqrt(up)
        plane = direction[:, :2] / (up + 0.15) * 60.0 + self.cloud_shift
        cell = plane.astype(np.int32) & (TILE - 1)
        cover = np.clip(turbulence()[cell[:, 1], cell[:, 0]] + 2.0 * self.clouds - 1.0, 0.0, 1.0)[:, None]
        white = self.horizon.mean() * (1.25 - 0.35 * self.clouds)
        colour = colour + cover * (white - colour)
        if self.sun.any():
            glow = np.maximum(direction @ self.sun_direction, 0.0)[:, None]
            colour = colour + self.sun * (0.12 * glow**8 + 3.0 * glow**400)
        return np.asarray(colour, dtype=np.float32)


def sample_weather(generator: Generator) -> Weather:
    """Draw a time of day and a weather: sunny, hazy, cloudy or overcast."""
    overcast = generator.random() < 0.28
    elevation = np.radians(generator.uniform(12.0, 65.0))
    azimuth = generator.uniform(0.0, 2.0 * np.pi)
    direction = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    warmth = np.clip(1.0 - elevation / 0.8, 0.0, 1.0) * generator.uniform(0.5, 1.0)
    sun = generator.uniform(1.3, 4.0) * np.array([1.0, 0.95 - 0.15 * warmth, 0.88 - 0.35 * warmth])
    blue = np.array([0.30, 0.48, 0.85]) * generator.uniform(0.6, 1.0)
    grey = np.array([0.78, 0.82, 0.86]) * generator.uniform(0.7, 1.1)
    clouds = generator.uniform(0.8, 1.0) if overcast else generator.uniform(0.0, 0.65)
    zenith = blue * (1.0 - 0.9 * clouds) + grey * 0.9 * clouds
    horizon = (
        np.array([0.85, 0.90, 0.95]) * generator.uniform(0.75, 1.05) * (1.0, 1.0 - 0.1 * warmth, 1.0 - 0.25 * warmth)
    )
    shade = 1.0 if overcast else generator.uniform(0.35, 1.0)  # how light shadows are
    return Weather(
        sun_direction=direction.astype(np.float32),
        sun=np.zeros(3, dtype=np.float32) if overcast else sun.astype(np.float32),
        zenith=zenith.astype(np.float32),
        horizon=horizon.astype(np.float32),
        ambient=(shade * (0.5 * zenith + 0.5 * horizon)).astype(np.float32),
        bounce=np.array([0.20, 0.19, 0.17], dtype=np.float32) * np.float32(shade),
        clouds=float(clouds),
        cloud_shift=generator.uniform(0, 256, 2).astype(np.float32),
        visibility=float(np.exp(generator.uniform(np.log(150.0), np.log(2500.0)))),
    )
