"""One revolution of a spinning LiDAR, ray-cast: ranges with noise, intensities, lost returns."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from calibnet.datasets.synthetic.mesh import Mesh
from calibnet.datasets.synthetic.rig import Lidar
from calibnet.datasets.synthetic.shading import cast, texels
from calibnet.geometry.types import Transform


def ray_directions(lidar: Lidar, facing: float, sector: float) -> NDArray[np.float32]:
    """Unit directions ``[N, 3]`` in the LiDAR frame, within ``sector`` radians of azimuth ``facing``."""
    count = int(2.0 * sector / lidar.azimuth_step)
    azimuth = facing + (np.arange(count) - 0.5 * count) * lidar.azimuth_step
    grid = azimuth[None, :] + lidar.azimuth_shift[:, None]
    level = np.cos(lidar.elevation)[:, None]
    height = np.broadcast_to(np.sin(lidar.elevation)[:, None], grid.shape)
    directions = np.stack([level * np.cos(grid), level * np.sin(grid), height], axis=-1)
    return directions.reshape(-1, 3).astype(np.float32)


def scan(
    caster: Any,
    mesh: Mesh,
    lidar: Lidar,
    world_from_lidar: Transform,
    facing: float,
    sector: float,
    generator: Generator,
) -> NDArray[np.float32]:
    """Points ``[N, 4]``: x, y, z in the LiDAR frame, metres, and intensity 0..1.

    Args:
        caster: the ``RaycastingScene`` of ``mesh``.
        mesh: the world.
        lidar: the scanner.
        world_from_lidar: its pose, 4x4.
        facing: azimuth of the sector's middle, radians.
        sector: half its width, radians; pi for a whole revolution.
        generator: draws the noise and the lost returns.
    """
    directions = ray_directions(lidar, facing, sector)
    rotation = world_from_lidar[:3, :3].astype(np.float32)
    rays = directions @ rotation.T
    hits = cast(caster, world_from_lidar[:3, 3], rays)
    near = (hits.distance > lidar.minimum_range) & (hits.distance < lidar.maximum_range)
    hits, directions, rays = hits.select(near), directions[hits.rays[near]], rays[hits.rays[near]]
    cosine = np.abs(np.einsum("ij,ij->i", hits.normal, rays))
    retro = mesh.reflectance[hits.triangle] > 1.0
    echo = texels(mesh, hits, 0.003 * hits.distance)[:, 3] / np.float32(255.0) * mesh.reflectance[hits.triangle]
    echo = echo * np.where(retro, 1.0, 0.25 + 0.75 * cosine)
    share = hits.distance / lidar.maximum_range
    strength = echo * np.where(retro, 1.0, cosine**0.3) / (share**2 + 1e-3)
    lost = generator.random(len(echo)) < lidar.dropout + (1.0 - lidar.dropout) * np.exp(-strength / 0.12)
    glass = (mesh.gloss[hits.triangle] > 0.8) & (generator.random(len(echo)) < 0.6)
    kept = ~(lost | glass)

    distance = hits.distance[kept] + lidar.range_noise * generator.standard_normal(kept.sum()).astype(np.float32)
    bright = lidar.gain * echo[kept] * (1.0 - lidar.falloff * share[kept])
    bright = np.clip(bright, 0.0, 1.0) ** lidar.gamma + generator.normal(0.0, 0.02, kept.sum())
    points = np.empty((kept.sum(), 4), dtype=np.float32)
    points[:, :3] = directions[kept] * distance[:, None]
    points[:, 3] = np.round(np.clip(bright, 0.0, 1.0) * 100.0) / 100.0
    return points
