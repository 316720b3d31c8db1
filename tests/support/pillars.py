"""A road with a wall, a pillar before it and a car that drives by, scanned from anywhere along the road."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

WALL, PILLAR, CAR = 30.0, 12.0, 8.0
"""Metres ahead of the origin."""
CAR_WIDTH = 2.0


def scan(ahead: float, car_left: float, step_deg: float = 0.2) -> NDArray[np.float32]:
    """What a scanner of 64 rings sees ``ahead`` metres down the road, in the axes of one at the origin.

    Args:
        ahead: where it stands, x.
        car_left: how far to the left the car is at that time, y of its middle.
        step_deg: between two points of a ring.
    """
    azimuth, elevation = np.meshgrid(np.radians(np.arange(-40, 40, step_deg)), np.radians(np.linspace(-24, 2, 64)))
    ray = np.stack([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    ray = ray.reshape(3, -1)
    depth = np.full(ray.shape[1], np.inf)

    def hit(distance: NDArray[np.float64], there: NDArray[np.bool_]) -> None:
        np.minimum(depth, np.where((distance > 0) & there, distance, np.inf), out=depth)

    ground = -1.7 / np.where(ray[2] < 0, ray[2], -1e-9)
    hit(ground, ray[2] < -1e-6)
    for x, low, high, top in (
        (WALL, -50.0, 50.0, 6.0),
        (PILLAR, -3.0, -2.4, 4.0),
        (CAR, car_left - CAR_WIDTH / 2, car_left + CAR_WIDTH / 2, 0.0),
    ):
        distance = (x - ahead) / ray[0]
        y, z = distance * ray[1], distance * ray[2]
        hit(distance, (y > low) & (y < high) & (z < top))
    seen = np.isfinite(depth)
    points = (ray * depth)[:, seen].T + np.array([ahead, 0.0, 0.0])
    return np.concatenate([points, np.full((len(points), 1), 0.5)], axis=1).astype(np.float32)
