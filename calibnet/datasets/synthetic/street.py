"""Street furniture and people; standing on z = 0, facing x."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from calibnet.datasets.synthetic.mesh import Material, Mesh, blob, box, concatenate, cylinder, quads, rectangle
from calibnet.datasets.synthetic.textures import Atlas
from calibnet.datasets.synthetic.vehicles import bicycle


def metalwork(atlas: Atlas, generator: Generator) -> Material:
    """Painted or galvanised steel."""
    tone = generator.uniform(0.08, 0.5)
    return Material(atlas.pick("metal", generator), (tone, tone, tone), 0.1, 0.8)


def lamp_post(atlas: Atlas, generator: Generator) -> Mesh:
    """A street lamp with an arm towards +x, or a lantern."""
    metal = metalwork(atlas, generator)
    height = generator.uniform(3.5, 9.0)
    parts = [cylinder((0, 0, 0), (0, 0, height), (0.09, 0.05), metal), cylinder((0, 0, 0), (0, 0, 0.8), 0.12, metal)]
    lamp = Material(atlas.pick("lamp", generator), (0.9, 0.9, 0.85))
    if height > 5.0:
        reach = generator.uniform(0.8, 2.2)
        parts.append(cylinder((0, 0, height), (reach, 0, height + 0.3), 0.04, metal, 6))
        parts.append(box((reach, 0, height + 0.2), (0.6, 0.25, 0.12), metal))
    else:
        parts.append(blob((0, 0, height + 0.15), (0.2, 0.2, 0.25), lamp, generator, 0.0))
    return concatenate(parts)


def pole(atlas: Atlas, generator: Generator) -> Mesh:
    """A utility pole or a short post."""
    if generator.random() < 0.5:
        wood = Material(atlas.pick("bark", generator))
        height = generator.uniform(6.5, 9.0)
        parts = [cylinder((0, 0, 0), (0, 0, height), (0.15, 0.11), wood)]
        parts.append(box((0, 0, height - 0.6), (0.12, 1.8, 0.12), wood))
        return concatenate(parts)
    return cylinder((0, 0, 0), (0, 0, generator.uniform(2.0, 4.0)), 0.05, metalwork(atlas, generator))


def bollard(atlas: Atlas, generator: Generator) -> Mesh:
    """A bollard, delineator or traffic cone."""
    kind = int(generator.integers(3))
    paint = Material(atlas.pick("paint", generator), (0.9, 0.25, 0.08), 0.0, 2.0)
    if kind == 0:
        return cylinder((0, 0, 0), (0, 0, 0.7), (0.2, 0.04), paint)
    body = Material(atlas.pick("plain", generator), (0.9, 0.9, 0.9) if kind == 1 else (0.15, 0.15, 0.15))
    return concatenate(
        [cylinder((0, 0, 0), (0, 0, 1.0), 0.07, body), cylinder((0, 0, 0.75), (0, 0, 0.9), 0.075, paint)]
    )


def sign(atlas: Atlas, generator: Generator) -> Mesh:
    """A traffic sign: round, triangular or rectangular, facing -x (oncoming drivers)."""
    metal = metalwork(atlas, generator)
    height, size = generator.uniform(1.9, 2.8), generator.uniform(0.3, 0.45)
    sides = int(generator.choice([3, 4, 12, 12, 8]))
    face = Material(atlas.pick("sign", generator), reflectance=4.0)
    angle = np.linspace(0.0, 2.0 * np.pi, sides, endpoint=False) + (np.pi / 4 if sides == 4 else np.pi / 2)
    rim = np.stack([np.full(sides, -0.06), size * np.cos(angle), height + size * np.sin(angle)], 1)
    disc = np.stack([0.5 + 0.5 * np.cos(angle), 0.5 - 0.5 * np.sin(angle)], 1)
    center, middle = np.tile([[-0.06, 0.0, height]], (sides, 1)), np.full((sides, 2), 0.5)
    fan = np.stack([center, rim, np.roll(rim, -1, axis=0), center], axis=1)
    uv = np.stack([middle, disc, np.roll(disc, -1, axis=0), middle], axis=1)
    back = quads(np.add(fan, (0.02, 0.0, 0.0)), uv, Material(atlas.pick("metal", generator), (0.4, 0.4, 0.4)))
    return concatenate([cylinder((0, 0, 0), (0, 0, height + 0.4 * size), 0.035, metal, 7), quads(fan, uv, face), back])


def traffic_light(atlas: Atlas, generator: Generator) -> Mesh:
    """A signal head on a post, sometimes also on an arm towards +y."""
    metal, dark = metalwork(atlas, generator), Material(atlas.pick("black", generator))
    lamp = atlas.pick("lamp", generator)
    lit = int(generator.integers(3))

    def head(y: float, z: float) -> list[Mesh]:
        parts = [box((0, y, z), (0.25, 0.32, 0.95), dark)]
        for row, rgb in enumerate(((0.1, 0.9, 0.3), (1.0, 0.7, 0.1), (1.0, 0.1, 0.05))):
            glow = tuple(c * (1.5 if row == lit else 0.15) for c in rgb)
            spot = Material(lamp, (glow[0], glow[1], glow[2]))
            parts.append(rectangle((-0.13, y - 0.1, z + 0.08 + 0.3 * row), (0, 0.2, 0), (0, 0, 0.2), spot))
        return parts

    parts = [cylinder((0, 0, 0), (0, 0, 3.4), 0.07, metal), *head(0.0, 2.4)]
    if generator.random() < 0.5:
        reach = generator.uniform(2.5, 4.5)
        parts += [cylinder((0, 0, 0), (0, 0, 6.0), 0.1, metal), cylinder((0, 0, 5.9), (0, reach, 5.9), 0.06, metal)]
        parts += head(reach, 5.2)
    return concatenate(parts)


def bin_or_box(atlas: Atlas, generator: Generator) -> Mesh:
    """A wheelie bin, cabinet, post box or skip."""
    rgb = tuple(generator.uniform(0.05, 0.5, 3))
    body = Material(atlas.pick("plain", generator), (rgb[0], rgb[1], rgb[2]), 0.1)
    kind = int(generator.integers(3))
    if kind == 0:
        lid = Material(body.texture, (0.1, 0.1, 0.1))
        return concatenate([box((0, 0, 0.05), (0.55, 0.6, 0.95), body), box((0, 0, 1.0), (0.62, 0.68, 0.08), lid)])
    if kind == 1:
        return box((0, 0, 0), tuple(generator.uniform((0.3, 0.6, 0.9), (0.5, 1.4, 1.5))), body)
    return cylinder((0, 0, 0), (0, 0, 0.95), (0.22, 0.27), body, 10)


def bench(atlas: Atlas, generator: Generator) -> Mesh:
    """A park bench, along x."""
    wood, metal = Material(atlas.pick("planks", generator)), metalwork(atlas, generator)
    parts = [box((0, 0, 0.42), (1.7, 0.45, 0.05), wood), box((0, -0.22, 0.5), (1.7, 0.05, 0.4), wood)]
    return concatenate(parts + [box((x, 0, 0), (0.06, 0.4, 0.42), metal) for x in (-0.7, 0.7)])


def person(atlas: Atlas, generator: Generator) -> Mesh:
    """A standing or walking adult or child."""
    height = generator.uniform(1.2, 1.9)
    stride = generator.uniform(-0.35, 0.35)
    tones = [tuple(generator.uniform(0.03, 0.6, 3)) for _ in range(2)]
    shirt = Material(atlas.pick("cloth", generator), (tones[0][0], tones[0][1], tones[0][2]), paint=True)
    trousers = Material(atlas.pick("cloth", generator), (0.7 * tones[1][0], 0.7 * tones[1][1], 0.9 * tones[1][2]))
    shade, dye = generator.uniform(0.25, 0.8), generator.uniform(0.5, 3.0)
    skin = Material(atlas.pick("plain", generator), (shade, 0.72 * shade, 0.58 * shade))
    hair = Material(atlas.pick("black", generator), (dye, dye, dye))
    h = height
    parts = []
    for side in (-1.0, 1.0):
        foot = (side * stride, side * 0.09, 0.0)
        parts.append(cylinder(foot, (0, side * 0.08, 0.5 * h), (0.06, 0.09), trousers, 5))
        hand = (-side * 0.7 * stride, side * 0.26, 0.45 * h)
        parts.append(cylinder((0, side * 0.2, 0.8 * h), hand, (0.06, 0.04), shirt, 4))
    parts.append(blob((0, 0, 0.66 * h), (0.15, 0.22, 0.2 * h), shirt, generator, 0.05, 5, 7))
    parts.append(blob((0.01, 0, 0.93 * h), (0.09, 0.08, 0.07 * h), skin, generator, 0.03, 4, 6))
    parts.append(blob((-0.02, 0, 0.955 * h), (0.095, 0.09, 0.055 * h), hair, generator, 0.03, 4, 6))
    if generator.random() < 0.4:
        parts.append(
            box((-0.2, 0, 0.58 * h), (0.16, 0.3, 0.22 * h), Material(atlas.pick("cloth", generator), tones[1]))
        )
    return concatenate(parts)


def rock(atlas: Atlas, generator: Generator) -> Mesh:
    """A boulder, or a log."""
    if generator.random() < 0.3:
        return cylinder((-1.2, 0, 0.2), (1.2, 0, 0.25), 0.22, Material(atlas.pick("bark", generator)))
    radii = generator.uniform(0.25, 0.8, 3) * (1.2, 1.0, 0.7)
    stone = Material(atlas.pick(str(generator.choice(["concrete", "soil"])), generator))
    return blob((0, 0, 0.3 * radii[2]), radii, stone, generator, 0.3, 5, 8)


def cyclist(atlas: Atlas, generator: Generator) -> Mesh:
    """A person riding a bicycle along x."""
    rider = person(atlas, generator).placed((-0.1, 0.0, 0.35), scale=(1.0, 1.0, 0.85))
    return concatenate([bicycle(atlas, generator), rider])
