"""Ray casting and shading, shared by the camera and the LiDAR."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calibnet.datasets.synthetic.drawing import TILE
from calibnet.datasets.synthetic.mesh import Mesh
from calibnet.datasets.synthetic.textures import atlas, turbulence
from calibnet.datasets.synthetic.weather import Weather

Array = NDArray[np.float32]
_THREADS = 1
"""Threads per frame: the workers of training render frames in parallel."""


@dataclass(frozen=True, eq=False)
class Hits:
    """Hits of rays on the scene.

    Attributes:
        rays: ``[N]`` int64, indices of the rays.
        distance: ``[N]`` in lengths of the ray's direction: metres if that is a unit vector.
        triangle: ``[N]`` int64, indices of the triangles hit.
        barycentric: ``[N, 2]`` weights of a triangle's second and third corner.
        normal: ``[N, 3]`` unit normals, towards the ray's origin or away from it.
    """

    rays: NDArray[np.int64]
    distance: Array
    triangle: NDArray[np.int64]
    barycentric: Array
    normal: Array

    def select(self, mask: NDArray[np.bool_]) -> Hits:
        """The hits of a mask ``[N]``."""
        return Hits(
            self.rays[mask], self.distance[mask], self.triangle[mask], self.barycentric[mask], self.normal[mask]
        )


def caster(mesh: Mesh) -> Any:
    """The ``RaycastingScene`` of a mesh."""
    import open3d as o3d

    scene = o3d.t.geometry.RaycastingScene(nthreads=_THREADS)
    vertices = np.ascontiguousarray(mesh.corners.reshape(-1, 3))
    faces = np.arange(len(vertices), dtype=np.uint32).reshape(-1, 3)
    scene.add_triangles(o3d.core.Tensor.from_numpy(vertices), o3d.core.Tensor.from_numpy(faces))
    return scene


def _rays(origin: ArrayLike, directions: Array) -> Any:
    import open3d as o3d

    rays = np.empty((len(directions), 6), dtype=np.float32)
    rays[:, :3] = origin
    rays[:, 3:] = directions
    return o3d.core.Tensor.from_numpy(rays)


def cast(scene: Any, origin: ArrayLike, directions: Array) -> Hits:
    """First hits of rays in directions ``[N, 3]`` from one origin ``[3]``, or from one each ``[N, 3]``."""
    answer = scene.cast_rays(_rays(origin, directions), nthreads=_THREADS)
    distance = answer["t_hit"].numpy()
    rays = np.flatnonzero(np.isfinite(distance))
    triangle = answer["primitive_ids"].numpy()[rays].astype(np.int64)
    corner_weights, normals = answer["primitive_uvs"].numpy()[rays], answer["primitive_normals"].numpy()[rays]
    return Hits(rays, distance[rays], triangle, corner_weights, normals)


def occluded(scene: Any, origins: Array, direction: Array) -> NDArray[np.bool_]:
    """Whether points ``[N, 3]`` are occluded in a direction ``[3]``."""
    rays = _rays(origins, np.broadcast_to(direction, origins.shape))
    return np.asarray(scene.test_occlusions(rays, nthreads=_THREADS).numpy())


def texels(mesh: Mesh, hits: Hits, footprint: Array) -> NDArray[np.uint8]:
    """Colour and reflectance ``[N, 4]`` at hits; ``footprint`` ``[N]`` is the size of a pixel there, metres."""
    corner = mesh.uv[hits.triangle]
    a, b = hits.barycentric[:, :1], hits.barycentric[:, 1:]
    uv = corner[:, 0] * (1.0 - a - b) + corner[:, 1] * a + corner[:, 2] * b
    return atlas().sample(mesh.texture[hits.triangle], uv, footprint)


def radiance(
    scene: Any, mesh: Mesh, weather: Weather, hits: Hits, origin: Array, rays: Array, pixel_angle: float
) -> Array:
    """Linear colours ``[N, 3]`` of camera hits: texture, sun with shadows, sky, reflections, haze.

    Args:
        scene: the ``RaycastingScene`` of ``mesh``.
        mesh: the world.
        weather: its light.
        hits: hits of the camera's rays.
        origin: ``[3]`` the camera's position.
        rays: ``[N, 3]`` unit directions of the hits.
        pixel_angle: angle that a pixel spans, radians.
    """
    point = origin + rays * hits.distance[:, None]
    facing = np.einsum("ij,ij->i", hits.normal, rays)
    normal = hits.normal * -np.sign(facing)[:, None]
    cosine = np.abs(facing)

    footprint = pixel_angle * hits.distance / np.sqrt(np.maximum(cosine, 0.02))
    albedo = texels(mesh, hits, footprint)[:, :3].astype(np.float32)
    albedo *= albedo * np.float32(1.0 / 255.0**2)  # the tiles are sRGB-like, gamma 2
    albedo *= mesh.tint[hits.triangle]
    albedo *= _stains(point)[:, None]

    gloss = mesh.gloss[hits.triangle]
    up = 0.5 + 0.5 * normal[:, 2:]
    light = up * weather.ambient + (1.0 - up) * weather.bounce
    if weather.sun.any():
        slant = np.maximum(normal @ weather.sun_direction, 0.0)
        slant[gloss < 0.0] = 0.3 + 0.3 * slant[gloss < 0.0]
        lit = np.flatnonzero(slant > 0.0)
        shadow = occluded(scene, point[lit] + 0.02 * normal[lit], weather.sun_direction)
        slant[lit[shadow]] = 0.0
        light = light + slant[:, None] * weather.sun
    colour: Array = albedo * light

    shiny = np.flatnonzero(gloss > 0.0)
    if len(shiny):
        mirror = rays[shiny] - 2.0 * (rays[shiny] * normal[shiny]).sum(axis=1, keepdims=True) * normal[shiny]
        fresnel = gloss[shiny] * (0.08 + 0.92 * (1.0 - cosine[shiny]) ** 4)
        seen = np.where(mirror[:, 2:] > 0.05, weather.sky(mirror), 0.15 * weather.horizon)
        colour[shiny] += fresnel[:, None] * (seen - colour[shiny])
    haze = 1.0 - np.exp(-hits.distance / weather.visibility)
    colour += haze[:, None] * (weather.horizon - colour)
    return colour


def _stains(point: Array) -> Array:
    """A slow change of brightness over the world, so that repeated tiles do not show."""
    cell = (point * np.float32(9.0)).astype(np.int32) & (TILE - 1)
    stain: Array = turbulence()[(cell[:, 1] + cell[:, 2]) & (TILE - 1), cell[:, 0]]
    return np.float32(0.7) + np.float32(0.6) * stain
