"""Town houses, office blocks, detached houses and sheds; the front faces -y at y = 0, centred on x = 0."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from calibnet.datasets.synthetic.mesh import Material, Mesh, box, concatenate, cylinder, quads, rectangle, triangles
from calibnet.datasets.synthetic.textures import Atlas


def _tint(generator: Generator, spread: float = 0.2) -> tuple[float, float, float]:
    grey = generator.uniform(0.55, 1.15)
    r, g, b = grey * (1.0 + spread * generator.uniform(-0.5, 0.5, 3) * (1.0, 0.6, 1.0))
    return float(r), float(g), float(b)


def _walls(width: float, depth: float, low: float, high: float, material: Material, scale: float = 1.0) -> Mesh:
    """Four walls between two heights; ``scale`` stretches the texture."""
    w = 0.5 * width
    corners = [(-w, 0.0), (w, 0.0), (w, depth), (-w, depth)]
    parts, runs = [], []
    for i, (a, b) in enumerate(zip(corners, corners[1:] + corners[:1], strict=True)):
        length = (width if i % 2 == 0 else depth) * scale
        tall = (high - low) * scale
        parts.append([(*a, low), (*b, low), (*b, high), (*a, high)])
        runs.append([(0.0, tall), (length, tall), (length, 0.0), (0.0, 0.0)])
    return quads(parts, runs, material)


def town_house(atlas: Atlas, generator: Generator, width: float, storeys: int) -> Mesh:
    """A house of a closed street front: shop or entrance below, windows above, ledges, balconies."""
    depth, floor = generator.uniform(9.0, 14.0), generator.uniform(2.9, 3.4)
    base, height = 4.0 if generator.random() < 0.5 else floor, 0.0
    height = base + floor * (storeys - 1)
    tint = _tint(generator)
    facade = Material(atlas.pick("facade", generator), tint)
    lower = Material(atlas.pick("ground_floor", generator), _tint(generator))
    trim = Material(atlas.pick("concrete", generator), _tint(generator, 0.05))
    roof = Material(atlas.pick("roof", generator))
    bays = max(1, round(width / 6.0))
    scale = 6.0 * bays / width  # whole bays only
    parts = [
        _walls(width, depth, 0.0, base, lower, 4.0 / base),
        _walls(width, depth, base, height, facade, scale),
        box((0.0, -0.12, base - 0.1), (width, 0.3, 0.22), trim),
        box((0.0, -0.18, height - 0.25), (width, 0.45, 0.3), trim),
    ]
    if generator.random() < 0.5:
        parts.append(_gable(width + 0.3, depth, height, generator.uniform(2.0, 4.0), roof, facade, along=True))
    else:
        parts.append(box((0.0, 0.5 * depth, height), (width, depth, generator.uniform(0.3, 1.0)), trim))
    if generator.random() < 0.45:
        rail = Material(atlas.pick("fence", generator), _tint(generator))
        for storey in range(1, storeys):
            z = base + floor * (storey - 1)
            for x in (np.arange(bays) + 0.5) * width / bays - 0.5 * width:
                reach, span = 1.1, 0.35 * width / bays
                parts.append(box((x, -0.5 * reach, z), (2 * span, reach, 0.14), trim))
                parts.append(rectangle((x - span, -reach, z + 0.14), (2 * span, 0, 0), (0, 0, 0.95), rail))
                for side in (-span, span):
                    parts.append(rectangle((x + side, -reach, z + 0.14), (0, reach, 0), (0, 0, 0.95), rail))
    for x in (-0.5 * width + 0.1, 0.5 * width - 0.1):
        if generator.random() < 0.5:
            parts.append(cylinder((x, -0.07, 0.0), (x, -0.07, height), 0.06, trim, 5))
    if generator.random() < 0.3:
        awning = Material(atlas.pick("cloth", generator), tuple(generator.uniform(0.2, 1.0, 3)))
        w, z = 0.35 * width, 2.9
        slope = [[(-w, 0, z), (w, 0, z), (w, -1.3, z - 0.5), (-w, -1.3, z - 0.5)]]
        parts.append(quads(slope, [[(0, 0), (2 * w, 0), (2 * w, 1.4), (0, 1.4)]], awning))
    for _ in range(int(generator.integers(0, 3))):
        x, y = generator.uniform(-0.4, 0.4) * width, generator.uniform(0.3, 0.6) * depth
        parts.append(box((x, y, height), (0.8, 0.6, generator.uniform(1.5, 4.5)), trim))
    return concatenate(parts)


def _gable(width: float, depth: float, eaves: float, rise: float, roof: Material, wall: Material, along: bool) -> Mesh:
    """A pitched roof, its ridge along x (``along``) or along y, with gable walls."""
    w, over = 0.5 * width, 0.4
    if along:
        a, b, c, d = (-w, -over), (w, -over), (w, depth + over), (-w, depth + over)
        ridge = ((-w, 0.5 * depth), (w, 0.5 * depth))
    else:
        a, b, c, d = (w + over, 0.0), (w + over, depth), (-w - over, depth), (-w - over, 0.0)
        ridge = ((0.0, 0.0), (0.0, depth))
    top = eaves + rise
    slope = float(np.hypot(0.5 * (depth if along else width), rise))
    run = width if along else depth
    uv = [[(0, slope), (run, slope), (run, 0), (0, 0)]] * 2
    z = eaves - 0.05
    planes = [
        [(*a, z), (*b, z), (*ridge[1], top), (*ridge[0], top)],
        [(*d, z), (*c, z), (*ridge[1], top), (*ridge[0], top)],
    ]
    ends = [[(*a, z), (*d, z), (*ridge[0], top)], [(*b, z), (*c, z), (*ridge[1], top)]]
    end_uv = [[(0, 0), (run, 0), (0.5 * run, -rise)]] * 2
    return concatenate([quads(planes, uv, roof), triangles(ends, end_uv, wall)])


def detached_house(atlas: Atlas, generator: Generator, width: float, storeys: int) -> Mesh:
    """A family house with a pitched roof, porch, separate windows and perhaps a garage."""
    depth, height = generator.uniform(7.0, 10.0), 2.7 * min(storeys, 2) + 0.3
    wall = Material(atlas.pick(str(generator.choice(["plaster", "brick", "planks"])), generator), _tint(generator))
    roof = Material(atlas.pick("roof", generator))
    trim = Material(atlas.pick("plain", generator), _tint(generator, 0.1))
    glass = Material(atlas.pick("glass", generator), (1.0, 1.0, 1.0), 0.6)
    door = Material(atlas.pick("planks", generator), tuple(generator.uniform(0.1, 0.8, 3)))
    parts = [
        _walls(width, depth, 0.0, height, wall),
        _gable(width, depth, height, generator.uniform(2.0, 4.0), roof, wall, along=generator.random() < 0.6),
        rectangle((-0.5, -0.02, 0.1), (1.0, 0, 0), (0, 0, 2.1), door),
        box((0.0, -0.7, 0.0), (1.8, 1.3, 0.15), trim),
    ]
    for z in np.arange(0.9, height - 1.5, 2.7):
        for x in np.arange(-0.5 * width + 1.0, 0.5 * width - 1.5, generator.uniform(2.2, 3.2)):
            if z > 2.0 or abs(x + 0.6) > 1.3:
                w, h = 1.2, 1.3
                parts.append(box((x + 0.6, -0.01, z - 0.08), (w + 0.16, 0.14, 0.08), trim))
                parts.append(rectangle((x - 0.08, -0.015, z - 0.08), (w + 0.16, 0, 0), (0, 0, h + 0.16), trim))
                parts.append(rectangle((x, -0.025, z), (w, 0, 0), (0, 0, h), glass))
                parts.append(rectangle((x + 0.5 * w - 0.03, -0.03, z), (0.06, 0, 0), (0, 0, h), trim))
        for side in (-1.0, 1.0):
            for y in (0.3 * depth, 0.65 * depth):
                x = side * (0.5 * width + 0.02)
                parts.append(rectangle((x, y, z), (0, 1.2, 0), (0, 0, 1.3), glass))
    if generator.random() < 0.5:
        parts.append(box((0.5 * width - 1.2, 0.4 * depth, height), (0.7, 0.7, generator.uniform(2.5, 4.5)), wall))
    if generator.random() < 0.5:
        x = 0.5 * width + 1.7
        parts.append(box((x, 0.5 * depth, 0.0), (3.2, 0.7 * depth, 2.5), wall))
        parts.append(rectangle((x - 1.2, 0.14 * depth, 0.0), (2.4, 0, 0), (0, 0, 2.1), trim))
    return concatenate(parts)


def block(atlas: Atlas, generator: Generator, width: float, storeys: int) -> Mesh:
    """An office block, warehouse or tower set back from the road."""
    depth, height = generator.uniform(10.0, 18.0), 3.2 * storeys
    name = str(generator.choice(["facade", "facade", "facade", "metal", "concrete"]))
    wall = Material(atlas.pick(name, generator), _tint(generator), 0.0)
    trim = Material(atlas.pick("concrete", generator), _tint(generator, 0.05))
    parts = [
        _walls(width, depth, 0.0, height, wall, 6.0 / (width / max(1, round(width / 6.0)))),
        box((0.0, 0.5 * depth, height), (width + 0.3, depth + 0.3, 0.6), trim),
    ]
    for x in np.linspace(-0.5 * width, 0.5 * width, int(generator.integers(2, 6))):
        parts.append(box((x, -0.15, 0.0), (0.45, 0.4, height), trim))
    if name in ("metal", "concrete"):
        art = Material(atlas.pick("art", generator))
        parts.append(
            rectangle((-0.3 * width, -0.05, 0.6 * height), (0.5 * width, 0, 0), (0, 0, 0.25 * height), art, True)
        )
    return concatenate(parts)
