"""Tiles of surfaces: masonry, roads, soil, plants, wood, cloth, and printed panels."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from calibnet.datasets.synthetic.drawing import (
    TILE,
    Image,
    colour,
    flat,
    noise,
    rectangle,
    scribble,
    speckled,
)


def bricks(generator: Generator) -> Image:
    """A brick wall, 16 or 24 courses."""
    rows, columns = (16, 8) if generator.random() < 0.5 else (24, 10)
    base = np.array(colour(generator, 0.25, 0.6, 0.15)) * generator.choice([[1.25, 0.85, 0.7], [1.1, 1.0, 0.85]])
    y, x = np.mgrid[0:TILE, 0:TILE] / TILE
    row = np.floor(y * rows).astype(int)
    shifted = (x * columns + 0.5 * (row % 2)) % columns
    tone = generator.uniform(0.75, 1.2, (rows, columns))[row, shifted.astype(int)]
    mortar = ((y * rows) % 1.0 < 0.12) | (shifted % 1.0 < 0.06)
    image = flat(tuple(base), 0.35)
    image[..., :3] *= np.where(mortar, generator.choice([0.6, 1.5]), tone)[..., None]
    return image * (1.0 + 0.06 * noise(generator, 16, 4))[..., None]


def paving(generator: Generator) -> Image:
    """Slabs or setts with joints."""
    count = int(generator.choice([4, 6, 8, 16]))
    y, x = np.mgrid[0:TILE, 0:TILE] / TILE * count
    row = y.astype(int)
    x = (x + generator.choice([0.0, 0.5]) * (row % 2)) % count
    tone = generator.uniform(0.85, 1.12, (count, count))[row, x.astype(int)]
    joint = (y % 1.0 < 0.07) | (x % 1.0 < 0.07)
    image = flat(colour(generator, 0.4, 0.65, 0.1), 0.3)
    image[..., :3] *= np.where(joint, 0.7, tone)[..., None]
    return image * (1.0 + 0.07 * noise(generator, 8))[..., None]


def asphalt(generator: Generator) -> Image:
    """Asphalt with stones, cracks and sealed joints."""
    import cv2

    image = speckled(generator, colour(generator, 0.28, 0.5, 0.05), 0.15, 0.05, 4)
    image *= (1.0 + 0.10 * generator.normal(size=(TILE, TILE, 1))).astype(np.float32)
    for _ in range(int(generator.integers(0, 4))):  # cracks and sealed joints
        points = np.cumsum(generator.normal(0.0, 14.0, (20, 2)), axis=0) + generator.uniform(0, TILE, 2)
        tone = float(generator.uniform(0.1, 0.25))
        cv2.polylines(image, [points.astype(np.int32)], False, (tone, tone, tone, 0.08), 1, cv2.LINE_AA)
    return image


def grass(generator: Generator) -> Image:
    """Grass, green to dry."""
    dry = generator.uniform(0.0, 1.0)
    rgb = np.array([0.30, 0.42, 0.18]) * (1 - dry) + np.array([0.55, 0.50, 0.30]) * dry
    image = flat(tuple(rgb * generator.uniform(0.7, 1.1)), 0.45)
    image *= (1.0 + 0.10 * noise(generator, 4, 6, 0.85) + 0.14 * noise(generator, 32, 4, 0.9))[..., None]
    image[..., 0] *= 1.0 + 0.05 * noise(generator, 4)
    return image


def soil(generator: Generator) -> Image:
    """Bare soil or gravel."""
    rgb = np.array([0.52, 0.43, 0.33]) * generator.uniform(0.6, 1.2)
    grain = 0.09 * noise(generator, 4, 6, 0.8) + 0.10 * noise(generator, 32, 4, 0.9)
    image = flat(tuple(rgb), 0.3)
    image *= (1.0 + grain)[..., None]
    return image


def leaves(generator: Generator) -> Image:
    """Foliage."""
    kind = generator.choice([[0.24, 0.31, 0.16], [0.30, 0.35, 0.18], [0.19, 0.27, 0.17], [0.36, 0.36, 0.24]])
    image = flat(tuple(np.array(kind) * generator.uniform(0.7, 1.2)), 0.5)
    image *= np.clip(1.0 + 0.25 * noise(generator, 8, 5, 0.9) + 0.35 * noise(generator, 32, 4, 0.9), 0.1, 2.4)[
        ..., None
    ]
    return image


def bark(generator: Generator) -> Image:
    """Bark, streaked upwards."""
    image = flat(colour(generator, 0.2, 0.45, 0.15), 0.4)
    stripes = np.repeat(noise(generator, 16, 4, 0.8)[:32], TILE // 32, axis=0)
    return image * (1.0 + 0.25 * stripes)[..., None]


def roof_tiles(generator: Generator) -> Image:
    """Courses of roof tiles."""
    rows = 16
    rgb = np.array(colour(generator, 0.25, 0.5, 0.1)) * generator.choice([[1.4, 0.85, 0.65], [1.0, 1.0, 1.05]])
    y, x = np.mgrid[0:TILE, 0:TILE] / TILE * rows
    image = flat(tuple(rgb), 0.35)
    image[..., :3] *= (0.75 + 0.35 * (y % 1.0) + 0.1 * np.cos(2 * np.pi * x))[..., None]
    return image * (1.0 + 0.1 * noise(generator, 8))[..., None]


def planks(generator: Generator) -> Image:
    """Upright boards."""
    count = int(generator.choice([8, 12, 16]))
    x = np.arange(TILE) / TILE * count
    tone = generator.uniform(0.8, 1.2, count)[x.astype(int)] * np.where(x % 1.0 < 0.12, 0.4, 1.0)
    image = flat(colour(generator, 0.3, 0.8, 0.2), 0.4)
    image *= (tone * (1.0 + 0.06 * noise(generator, 8)))[..., None].astype(np.float32)
    return image


def metal(generator: Generator) -> Image:
    """Light sheet metal, to be tinted."""
    return speckled(generator, (0.8, 0.8, 0.8), 0.4, 0.03, 2)


def panel_art(generator: Generator) -> Image:
    """Advertisements, lorry sides, graffiti: strong edges where depth has none."""
    image = speckled(generator, colour(generator, 0.2, 0.9, 0.4), 0.5, 0.02)
    for _ in range(int(generator.integers(2, 7))):
        x, y, w, h = generator.uniform(0, 0.8), generator.uniform(0, 0.8), *generator.uniform(0.05, 0.5, 2)
        rectangle(image, x, y, x + w, y + h, colour(generator, 0.1, 0.95, 0.7), 0.5)
    for _ in range(int(generator.integers(0, 4))):
        y = generator.uniform(0.05, 0.8)
        scribble(image, generator, generator.uniform(0, 0.3), y, 0.9, y + generator.uniform(0.05, 0.2))
    return image


def sign_face(generator: Generator) -> Image:
    """A traffic sign: coloured ground, rim and lettering, retro-reflective."""
    import cv2

    ground = [(0.9, 0.9, 0.9), (0.1, 0.25, 0.7), (0.1, 0.45, 0.25), (0.9, 0.75, 0.1), (0.75, 0.1, 0.1)]
    image = flat(ground[int(generator.integers(len(ground)))], 0.95)
    rim = [(0.8, 0.1, 0.1, 0.9), (0.95, 0.95, 0.95, 0.95), (0.1, 0.1, 0.1, 0.3)][int(generator.integers(3))]
    cv2.rectangle(image, (6, 6), (TILE - 7, TILE - 7), rim, 14)
    for _ in range(int(generator.integers(1, 4))):
        y = generator.uniform(0.15, 0.7)
        scribble(image, generator, 0.15, y, 0.85, y + 0.18)
    return image


def wheel(generator: Generator) -> Image:
    """A wheel seen from the side."""
    import cv2

    image = flat((0.1, 0.1, 0.1), 0.06)
    tone = float(generator.uniform(0.35, 0.75))
    cv2.circle(image, (TILE // 2, TILE // 2), 84, (tone, tone, tone, 0.5), -1, cv2.LINE_AA)
    for angle in np.arange(5) * 2 * np.pi / 5:
        tip = (int(128 + 55 * np.cos(angle)), int(128 + 55 * np.sin(angle)))
        cv2.circle(image, tip, 17, (0.12, 0.12, 0.12, 0.1), -1, cv2.LINE_AA)
    return image


def cloth(generator: Generator) -> Image:
    """Cloth, plain or striped, to be tinted."""
    image = speckled(generator, (0.8, 0.8, 0.8), 0.4, 0.12, 4)
    if generator.random() < 0.4:
        stripe = (np.arange(TILE) // int(generator.choice([8, 16, 32]))) % 2
        image[..., :3] *= (0.55 + 0.45 * stripe)[:, None, None]
    return image


def mesh_fence(generator: Generator) -> Image:
    """Wire or bars before a darker ground."""
    count = int(generator.choice([16, 32]))
    y, x = np.mgrid[0:TILE, 0:TILE] / TILE * count
    lines = (x % 1.0 < 0.25) | (y % 1.0 < 0.12)
    image = flat(colour(generator, 0.2, 0.4, 0.2), 0.25)
    image[lines] = (*colour(generator, 0.3, 0.8, 0.2), 0.4)
    return image


def kerb(generator: Generator) -> Image:
    """Kerb stones, grey or painted in two colours."""
    image = speckled(generator, colour(generator, 0.45, 0.75, 0.05), 0.4, 0.06)
    if generator.random() < 0.5:
        rectangle(image, 0.5, 0.0, 1.0, 1.0, colour(generator, 0.08, 0.9, 0.1), 0.4)
    for joint in (0.0, 0.5):
        rectangle(image, joint, 0.0, joint + 0.012, 1.0, (0.2, 0.2, 0.2), 0.3)
    return image
