"""Large and linear structures: fences, walls, crash barriers, sign gantries, bridges, billboards."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from calibnet.datasets.synthetic.mesh import Material, Mesh, box, concatenate, cylinder, rectangle
from calibnet.datasets.synthetic.street import metalwork
from calibnet.datasets.synthetic.textures import Atlas


def fence(atlas: Atlas, generator: Generator) -> Mesh:
    """A fence, railing or wall segment, 4 m long along x."""
    kind = int(generator.integers(4))
    height = generator.uniform(0.8, 2.0)
    if kind == 0:
        return box((0, 0, 0), (4.0, 0.04, height), Material(atlas.pick("planks", generator)))
    if kind == 1:
        texture = atlas.pick(str(generator.choice(["brick", "concrete", "plaster"])), generator)
        cap = Material(atlas.pick("concrete", generator))
        wall = box((0, 0, 0), (4.0, 0.25, height), Material(texture))
        return concatenate([wall, box((0, 0, height), (4.0, 0.33, 0.06), cap)])
    metal = metalwork(atlas, generator)
    gap = 0.14 if kind == 2 else 1.0
    parts = [box((x, 0, 0), (0.03, 0.03, height), metal) for x in np.arange(-2.0, 2.0, gap)]
    for z in (0.12, 0.5 * height, height) if kind == 3 else (0.12, height):
        parts.append(box((0, 0, z), (4.0, 0.04, 0.04 if kind == 2 else 0.12), metal))
    return concatenate(parts)


def guard_rail(atlas: Atlas, generator: Generator) -> Mesh:
    """A motorway barrier, 4 m long along x: steel rail on posts, or concrete."""
    if generator.random() < 0.35:
        concrete = Material(atlas.pick("concrete", generator))
        low, high = box((0, 0, 0), (4.0, 0.6, 0.3), concrete), box((0, 0, 0.3), (4.0, 0.25, 0.6), concrete)
        return concatenate([low, high])
    steel = Material(atlas.pick("metal", generator), (0.5, 0.52, 0.54), 0.2)
    parts = [box((0, 0, z), (4.0, 0.06, 0.13), steel) for z in (0.45, 0.64)]
    parts.append(box((0, 0.02, 0.55), (4.0, 0.02, 0.12), steel))
    return concatenate(parts + [box((x, 0.08, 0), (0.1, 0.08, 0.75), steel) for x in (-1.5, 0.5)])


def gantry(atlas: Atlas, generator: Generator) -> Mesh:
    """A sign bridge across y, 24 m wide, faces towards -x."""
    metal = metalwork(atlas, generator)
    parts = [box((0, y, 0), (0.4, 0.4, 7.0), metal) for y in (-12.0, 12.0)]
    parts += [box((0, 0, z), (0.25, 24.0, 0.2), metal) for z in (5.9, 6.9)]
    for y in np.arange(-12.0, 12.0, 1.5):
        parts.append(cylinder((0, y, 6.0), (0, y + 1.5, 6.95), 0.05, metal, 4))
    for y in generator.choice([-9.0, -4.5, 0.5, 5.0], 2, replace=False):
        face = Material(atlas.pick("sign", generator), reflectance=3.0)
        size = generator.uniform(2.0, 3.0)
        parts.append(rectangle((-0.3, y, 5.4), (0, 1.4 * size, 0), (0, 0, size), face, unit_uv=True))
    return concatenate(parts)


def billboard(atlas: Atlas, generator: Generator) -> Mesh:
    """An advertising panel facing -x."""
    metal, art = metalwork(atlas, generator), Material(atlas.pick("art", generator))
    width, height, lift = generator.uniform(1.2, 4.0), generator.uniform(1.4, 2.6), generator.uniform(0.4, 2.5)
    panel = box((0, 0, lift), (0.15, width, height), metal)
    face = rectangle((-0.09, -0.48 * width, lift + 0.05), (0, 0.96 * width, 0), (0, 0, height - 0.1), art, unit_uv=True)
    return concatenate([panel, face, box((0, 0, 0), (0.12, 0.12, lift), metal)])


def bridge(atlas: Atlas, generator: Generator) -> Mesh:
    """A road or footbridge across y, 60 m wide, on piers beside the carriageway."""
    concrete = Material(atlas.pick("concrete", generator))
    depth, clear = generator.uniform(3.0, 12.0), generator.uniform(5.2, 6.5)
    parts = [
        box((0, 0, clear), (depth, 60.0, generator.uniform(0.8, 1.6)), concrete),
        *[box((x, 0, clear + 1.0), (0.2, 60.0, 1.1), metalwork(atlas, generator)) for x in (-0.5 * depth, 0.5 * depth)],
    ]
    for y in (-17.0, 17.0):
        parts.append(box((0, y, -1.0), (0.8 * depth, 1.2, clear + 1.0), concrete))
    return concatenate(parts)
