"""Triangle soups, of which all objects of the synthetic world are made; a scene is their concatenation."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike, NDArray

from calibnet.geometry.types import Floats

Array = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles that share no vertices, so that every one carries its own material.

    Attributes:
        corners: ``[T, 3, 3]`` float32, metres.
        uv: ``[T, 3, 2]`` float32, texture coordinates in metres (the atlas knows how large a tile is).
        texture: ``[T]`` int32, layer of the texture atlas.
        tint: ``[T, 3]`` float32, linear RGB factor on the texture.
        gloss: ``[T]`` float32, 0 (matte) to 1 (mirror-like: car paint, glass); below 0 for foliage, which
            scatters light independently of its normal.
        reflectance: ``[T]`` float32, LiDAR factor on the texture's own; above 1 is retro-reflective.
        paint: ``[T]`` bool, triangles that take the colour given to ``placed``.
    """

    corners: Array
    uv: Array
    texture: NDArray[np.int32]
    tint: Array
    gloss: Array
    reflectance: Array
    paint: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.texture)

    def placed(
        self,
        position: ArrayLike,
        heading: float = 0.0,
        scale: ArrayLike = 1.0,
        colour: ArrayLike | None = None,
        lean: float = 0.0,
    ) -> Mesh:
        """Scale, rotate about z by ``heading`` (and about x by ``lean``), and move; recolour the painted triangles."""
        c, s = np.cos(heading), np.sin(heading)
        rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        if lean:
            ca, sa = np.cos(lean), np.sin(lean)
            rotation = rotation @ np.array([[1.0, 0.0, 0.0], [0.0, ca, -sa], [0.0, sa, ca]])
        matrix = (rotation * np.asarray(scale, dtype=np.float64)).astype(np.float32)
        corners = self.corners.reshape(-1, 3) @ matrix.T + np.asarray(position, dtype=np.float32)
        tint = self.tint
        if colour is not None:
            tint = np.where(self.paint[:, None], np.asarray(colour, dtype=np.float32), tint)
        return replace(self, corners=corners.reshape(-1, 3, 3), tint=tint)


@dataclass(frozen=True)
class Material:
    """The material of a primitive; fields as in `Mesh`."""

    texture: int
    tint: tuple[float, float, float] = (1.0, 1.0, 1.0)
    gloss: float = 0.0
    reflectance: float = 1.0
    paint: bool = False


def concatenate(meshes: Iterable[Mesh]) -> Mesh:
    """Join meshes into one."""
    parts = list(meshes)
    return Mesh(
        corners=np.concatenate([m.corners for m in parts]),
        uv=np.concatenate([m.uv for m in parts]),
        texture=np.concatenate([m.texture for m in parts]),
        tint=np.concatenate([m.tint for m in parts]),
        gloss=np.concatenate([m.gloss for m in parts]),
        reflectance=np.concatenate([m.reflectance for m in parts]),
        paint=np.concatenate([m.paint for m in parts]),
    )


def triangles(corners: ArrayLike, uv: ArrayLike, material: Material) -> Mesh:
    """A mesh of triangles ``[T, 3, 3]`` with texture coordinates ``[T, 3, 2]`` and one material."""
    points = np.asarray(corners, dtype=np.float32)
    count = len(points)
    return Mesh(
        corners=points,
        uv=np.asarray(uv, dtype=np.float32),
        texture=np.full(count, material.texture, dtype=np.int32),
        tint=np.tile(np.asarray(material.tint, dtype=np.float32), (count, 1)),
        gloss=np.full(count, material.gloss, dtype=np.float32),
        reflectance=np.full(count, material.reflectance, dtype=np.float32),
        paint=np.full(count, material.paint, dtype=np.bool_),
    )


def quads(corners: ArrayLike, uv: ArrayLike, material: Material) -> Mesh:
    """A mesh of quadrilaterals ``[Q, 4, 3]`` with texture coordinates ``[Q, 4, 2]``."""
    split = np.array([[0, 1, 2], [0, 2, 3]])
    points = np.asarray(corners, dtype=np.float32)[:, split].reshape(-1, 3, 3)
    return triangles(points, np.asarray(uv, dtype=np.float32)[:, split].reshape(-1, 3, 2), material)


def patches(grid: Floats) -> Floats:
    """The cells ``[(H - 1) * (W - 1), 4, C]`` between the points of a grid ``[H, W, C]``, as quadrilaterals."""
    cells = [grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]]
    return np.stack(cells, axis=2).reshape(-1, 4, grid.shape[-1])


def rectangle(origin: ArrayLike, along: ArrayLike, up: ArrayLike, material: Material, unit_uv: bool = False) -> Mesh:
    """One rectangle from a corner and two edge vectors; ``unit_uv`` stretches one tile over it."""
    corner, a, b = (np.asarray(vector, dtype=np.float64) for vector in (origin, along, up))
    length, height = (1.0, 1.0) if unit_uv else (float(np.linalg.norm(a)), float(np.linalg.norm(b)))
    uv = [[0.0, height], [length, height], [length, 0.0], [0.0, 0.0]]
    return quads([[corner, corner + a, corner + a + b, corner + b]], [uv], material)


_BOX = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (0.0, 1.0)])
_BOX_FACES = np.array([[0, 4, 5, 1], [2, 6, 7, 3], [0, 2, 3, 1], [4, 6, 7, 5], [1, 5, 7, 3], [0, 4, 6, 2]])
_BOX_AXES = ((0, 2), (0, 2), (1, 2), (1, 2), (0, 1), (0, 1))


def box(base: ArrayLike, size: Sequence[float], material: Material, top: Material | None = None) -> Mesh:
    """A box standing on ``base`` (centre of its floor), ``size`` = (x, y, z)."""
    extent = np.asarray(size, dtype=np.float64)
    local = _BOX * extent
    corners = (local + np.asarray(base, dtype=np.float64))[_BOX_FACES]
    uv = np.stack([local[face][:, axes] for face, axes in zip(_BOX_FACES, _BOX_AXES, strict=True)])
    uv[:4, :, 1] = extent[2] - uv[:4, :, 1]  # images have v downwards
    if top is None:
        return quads(corners, uv, material)
    return concatenate([quads(corners[:4], uv[:4], material), quads(corners[4:], uv[4:], top)])


def loft(rings: ArrayLike, material: Material, closed: bool = True, caps: bool = True) -> Mesh:
    """A skin through rings ``[R, P, 3]`` of points; caps close the first and last ring."""
    ring = np.asarray(rings, dtype=np.float64)
    if closed:
        ring = np.concatenate([ring, ring[:, :1]], axis=1)
    around = np.linalg.norm(np.diff(ring, axis=1), axis=2).cumsum(axis=1)
    u = np.concatenate([np.zeros((len(ring), 1)), around], axis=1)
    step = np.linalg.norm(np.diff(ring.mean(axis=1), axis=0), axis=1).cumsum()
    v = np.broadcast_to(np.concatenate([[0.0], step])[:, None], u.shape)
    uv = np.stack([u, -v], axis=-1)

    parts = [quads(patches(ring), patches(uv), material)]
    if closed and caps:
        for end in (ring[0, :-1], ring[-1, :-1]):
            fan = np.stack([np.broadcast_to(end.mean(axis=0), end.shape), end, np.roll(end, -1, axis=0)], axis=1)
            parts.append(triangles(fan, fan[:, :, 1:], material))
    return concatenate(parts)


def cylinder(
    start: ArrayLike, end: ArrayLike, radius: float | tuple[float, float], material: Material, sides: int = 8
) -> Mesh:
    """A (conical) cylinder between two points."""
    a, b = np.asarray(start, dtype=np.float64), np.asarray(end, dtype=np.float64)
    axis = (b - a) / np.linalg.norm(b - a)
    helper = np.array([1.0, 0.0, 0.0]) if abs(axis[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    first = np.cross(axis, helper)
    first /= np.linalg.norm(first)
    angle = np.linspace(0.0, 2.0 * np.pi, sides, endpoint=False)[:, None]
    circle = np.cos(angle) * first + np.sin(angle) * np.cross(axis, first)
    r0, r1 = radius if isinstance(radius, tuple) else (radius, radius)
    return loft([a + r0 * circle, b + r1 * circle], material)


def blob(
    center: ArrayLike,
    radii: ArrayLike,
    material: Material,
    generator: Generator,
    rough: float = 0.15,
    rows: int = 6,
    columns: int = 9,
) -> Mesh:
    """A lumpy ellipsoid: foliage, bushes, heads, boulders."""
    polar = np.linspace(0.0, np.pi, rows + 1)
    azimuth = np.linspace(0.0, 2.0 * np.pi, columns, endpoint=False)
    factor = 1.0 + rough * generator.uniform(-1.0, 1.0, (rows + 1, columns))
    factor[[0, -1]] = 1.0
    unit = np.stack(
        [
            np.sin(polar)[:, None] * np.cos(azimuth),
            np.sin(polar)[:, None] * np.sin(azimuth),
            np.broadcast_to(np.cos(polar)[:, None], factor.shape),
        ],
        axis=-1,
    )
    return loft(unit * factor[..., None] * np.asarray(radii) + np.asarray(center), material, caps=False)
