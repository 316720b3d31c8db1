"""Trees, bushes and hedges: lumpy hulls wrapped in shells of loose leaves, with gaps that rays pass through."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from calibnet.datasets.synthetic.mesh import Material, Mesh, blob, box, concatenate, cylinder, triangles
from calibnet.datasets.synthetic.textures import Atlas
from calibnet.geometry.types import Floats, Vector3


def _foliage(atlas: Atlas, generator: Generator) -> Material:
    return Material(atlas.pick("leaves", generator), gloss=-1.0, paint=True)


def _lumps(
    centers: Floats,
    radii: Floats,
    material: Material,
    generator: Generator,
    detail: float,
    shrink: float = 0.85,
) -> list[Mesh]:
    """The solid inside of a crown: ellipsoids ``[E, 3]``, shrunk to lie within their shells of leaves."""
    rows, columns = (4, 7) if detail == 1.0 else (3, 5)
    pairs = zip(centers, radii, strict=True)
    return [blob(center, shrink * radius, material, generator, 0.25, rows, columns) for center, radius in pairs]


def leaf_cloud(
    centers: Floats,
    radii: Floats,
    count: int,
    size: float,
    material: Material,
    generator: Generator,
    detail: float = 1.0,
) -> Mesh:
    """Leaves: ``count`` triangles of about ``size`` metres scattered in the shells of ellipsoids ``[E, 3]``.

    A ``detail`` below 1 keeps this share of the leaves and makes them larger, for distant plants.
    """
    count, size = int(count * detail), size * min(detail**-0.4, 1.7)
    which = generator.integers(len(centers), size=count)
    direction = generator.normal(size=(count, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    distance = generator.uniform(0.8, 1.05, (count, 1))
    middle = centers[which] + direction * distance * radii[which]
    corners = middle[:, None] + size * generator.uniform(-1.0, 1.0, (count, 3, 3))
    uv = generator.uniform(0.0, 2.0, (count, 1, 2)) + size * generator.uniform(-1.0, 1.0, (count, 3, 2))
    return triangles(corners, uv, material)


def broadleaf(atlas: Atlas, generator: Generator, detail: float) -> Mesh:
    """A deciduous tree of 5 to 12 m."""
    height = generator.uniform(5.0, 12.0)
    stem = generator.uniform(0.25, 0.42) * height
    bark = Material(atlas.pick("bark", generator))
    leaves = _foliage(atlas, generator)
    thick = 0.018 * height + generator.uniform(0.04, 0.12)
    lean = generator.normal(0.0, 0.25, 2)
    fork = np.array([lean[0], lean[1], stem])
    count = int(generator.integers(6, 11))
    spread = 0.25 * height * generator.uniform(0.8, 1.2)
    centers = fork + np.stack(
        [
            generator.normal(0.0, 0.45 * spread, count),
            generator.normal(0.0, 0.45 * spread, count),
            generator.uniform(0.1, 0.85, count) * (height - stem),
        ],
        axis=1,
    )
    radii = generator.uniform(0.5, 0.9, (count, 1)) * spread * np.array([1.0, 1.0, 0.8])
    centers[0], radii[0] = (
        np.array([fork[0], fork[1], 0.5 * (height + stem)]),
        (1.1 * spread, 1.1 * spread, 0.4 * (height - stem)),
    )
    parts = [cylinder((0, 0, -0.2), fork, (thick, 0.7 * thick), bark, 7)]
    parts += [cylinder(fork, center, (0.55 * thick, 0.02), bark, 4) for center in centers]
    parts += _lumps(centers, radii, leaves, generator, detail)
    parts.append(leaf_cloud(centers, radii, 640, generator.uniform(0.14, 0.24), leaves, generator, detail))
    return concatenate(parts)


def conifer(atlas: Atlas, generator: Generator, detail: float) -> Mesh:
    """A spruce or cypress: stacked cones with ragged edges."""
    height, radius = generator.uniform(4.0, 13.0), generator.uniform(0.9, 2.2)
    leaves = _foliage(atlas, generator)
    parts = [cylinder((0, 0, -0.2), (0, 0, 0.9 * height), (0.16, 0.04), Material(atlas.pick("bark", generator)), 6)]
    layers = int(generator.integers(4, 8))
    base = generator.uniform(0.05, 0.2) * height
    step = (height - base) / layers
    for layer in range(layers):
        z = base + layer * step
        wide = radius * (1.0 - 0.85 * layer / layers)
        parts.append(cylinder((0, 0, z), (0, 0, z + 1.5 * step), (wide, 0.1 * wide), leaves, 9))
    share = 1.0 - np.sqrt(generator.uniform(0.0, 1.0, 420))  # of the height, as the surface of a cone
    angle = generator.uniform(0.0, 2.0 * np.pi, 420)
    reach = radius * (1.0 - 0.9 * share) * generator.uniform(0.8, 1.15, 420)
    centers = np.stack([reach * np.cos(angle), reach * np.sin(angle), base + share * (height - base)], axis=1)
    parts.append(leaf_cloud(centers, np.full((420, 3), 0.15), 420, 0.2, leaves, generator, detail))
    return concatenate(parts)


def bare_tree(atlas: Atlas, generator: Generator, detail: float) -> Mesh:
    """A tree without leaves: branches of branches."""
    bark = Material(atlas.pick("bark", generator))
    height = generator.uniform(5.0, 9.0)
    parts: list[Mesh] = []

    def grow(start: Vector3, direction: Vector3, length: float, radius: float, depth: int) -> None:
        end = start + length * direction
        parts.append(cylinder(start, end, (radius, 0.6 * radius), bark, 5 if depth < 2 else 3))
        if depth == (3 if detail == 1.0 else 2):
            return
        for _ in range(3):
            bent = direction + generator.normal(0.0, 0.45, 3)
            grow(end, bent / np.linalg.norm(bent), generator.uniform(0.55, 0.8) * length, 0.55 * radius, depth + 1)

    grow(np.zeros(3), np.array([0.0, 0.0, 1.0]), 0.36 * height, generator.uniform(0.1, 0.2), 0)
    return concatenate(parts)


def bush(atlas: Atlas, generator: Generator, detail: float) -> Mesh:
    """A shrub of about one metre."""
    leaves = _foliage(atlas, generator)
    count = int(generator.integers(2, 5))
    centers = np.column_stack([generator.normal(0.0, 0.5, (count, 2)), generator.uniform(0.3, 0.6, count)])
    radii = generator.uniform(0.4, 0.8, (count, 3))
    lumps = _lumps(centers, radii, leaves, generator, detail)
    return concatenate([*lumps, leaf_cloud(centers, radii, 170, 0.10, leaves, generator, detail)])


def grass_tuft(atlas: Atlas, generator: Generator, detail: float) -> Mesh:
    """Tall grass: a fan of thin upright triangles."""
    count = int(46 * detail)
    foot = np.column_stack([generator.normal(0.0, 0.35, (count, 2)), np.full(count, -0.05)])
    tip = foot + np.column_stack([generator.normal(0.0, 0.15, (count, 2)), generator.uniform(0.2, 0.65, count)])
    width = 0.04 * generator.normal(size=(count, 3)) * (1.0, 1.0, 0.0)
    material = Material(atlas.pick("grass", generator), (1.2, 1.2, 1.0), paint=True)
    return triangles(
        np.stack([foot - width, foot + width, tip], axis=1), generator.uniform(0, 3, (count, 3, 2)), material
    )


def thicket(atlas: Atlas, generator: Generator, detail: float) -> Mesh:
    """A wall of wild shrubs and young trees, 10 m long along x."""
    leaves = _foliage(atlas, generator)
    count, height = 11, generator.uniform(1.5, 5.0)
    centers = np.column_stack(
        [np.linspace(-5, 5, count), generator.normal(0.0, 0.6, count), height * generator.uniform(0.25, 0.55, count)]
    )
    radii = np.column_stack(
        [generator.uniform(0.8, 1.5, (count, 2)), np.maximum(centers[:, 2] * generator.uniform(0.9, 1.2, count), 0.4)]
    )
    lumps = _lumps(centers, radii, leaves, generator, detail, shrink=0.88)
    return concatenate(
        [*lumps, leaf_cloud(centers, radii, 800, generator.uniform(0.16, 0.26), leaves, generator, detail)]
    )


def hedge(atlas: Atlas, generator: Generator, detail: float) -> Mesh:
    """A clipped hedge, 4 m long along x."""
    height, depth = generator.uniform(0.8, 2.0), generator.uniform(0.5, 0.9)
    leaves = _foliage(atlas, generator)
    hull = box((0, 0, 0), (4.0, depth, height), leaves)
    count = int(320 * detail)
    spot = np.column_stack(
        [
            generator.uniform(-2, 2, count),
            generator.choice([-0.5, 0.5], count) * depth,
            generator.uniform(0, height, count),
        ]
    )
    top = generator.random(count) < 0.3
    spot[top, 1], spot[top, 2] = generator.uniform(-0.5, 0.5, top.sum()) * depth, height
    corners = spot[:, None] + generator.normal(0.0, 0.09, (count, 3, 3))
    return concatenate([hull, triangles(corners, generator.uniform(0.0, 2.0, (count, 3, 2)), leaves)])
