"""Lorries, tankers and buses; x forward, standing on z = 0."""

from __future__ import annotations

import numpy as np

from calibnet.datasets.synthetic.mesh import Material, Mesh, box, concatenate, cylinder, loft, rectangle
from calibnet.datasets.synthetic.textures import Atlas
from calibnet.datasets.synthetic.vehicles import contact_shadow, cross_section, lamps_and_plates, wheels

Generator = np.random.Generator


def lorry(atlas: Atlas, generator: Generator) -> Mesh:
    """A lorry with a box body or container, or a bus."""
    bus = generator.random() < 0.3
    length = generator.uniform(10.0, 12.0) if bus else generator.uniform(7.0, 14.0)
    half, height = 1.25, generator.uniform(2.9, 3.3) if bus else generator.uniform(3.2, 3.9)
    front, rear = 0.5 * length, -0.5 * length
    cab = Material(atlas.pick("metal", generator), gloss=0.35, reflectance=0.9, paint=True)
    glass = Material(atlas.pick("glass", generator), gloss=0.9)
    dark = Material(atlas.pick("black", generator))
    parts = [
        wheels(atlas, (front - 1.3, rear + 1.4, rear + 2.5), half - 0.02, 0.48, generator),
        contact_shadow(atlas, length, half),
    ]
    if bus:
        parts.append(
            loft(
                [
                    cross_section(front, 1.15, 0.4, height - 0.1, 0.95),
                    cross_section(front - 0.3, half, 0.35, height, 0.96),
                    cross_section(rear, half, 0.35, height, 0.96),
                ],
                cab,
            )
        )
        panes = int(length // 1.4)
        for side in (-1.0, 1.0):
            for pane in range(panes):
                start = (rear + 0.4 + 1.4 * pane, side * (half + 0.01), 1.3)
                parts.append(rectangle(start, (1.28, 0, 0), (0, 0, 0.95), glass))
        parts.append(rectangle((front + 0.01, -1.0, 1.2), (0, 2.0, 0), (0, 0, 1.4), glass))
        parts.append(rectangle((rear - 0.01, -0.9, 1.6), (0, 1.8, 0), (0, 0, 0.8), glass))
    else:
        cabin_height = generator.uniform(2.5, 3.4)
        parts.append(box((front - 0.95, 0, 0.5), (1.9, 2.3, cabin_height - 0.5), cab))
        parts.append(rectangle((front + 0.01, -1.05, 1.5), (0, 2.1, 0), (0, 0, 0.85), glass))
        parts.append(rectangle((front + 0.01, -0.9, 0.7), (0, 1.8, 0), (0, 0, 0.6), dark))
        for side in (-1.0, 1.0):
            parts.append(rectangle((front - 1.3, side * 1.16, 1.5), (0.9, 0, 0), (0, 0, 0.75), glass))
        load = Material(atlas.pick(str(generator.choice(["plain", "metal", "planks"])), generator), paint=True)
        body = length - 2.3
        if generator.random() < 0.2:
            tank = Material(load.texture, (0.8, 0.8, 0.82), 0.3)
            middle, radius = 0.5 * height + 0.5, 0.5 * height - 0.5
            parts.append(cylinder((rear, 0, middle), (rear + body - 0.3, 0, middle), radius, tank, 16))
            parts += [box((rear + 0.5 * body, 0, 0.6), (body, 1.0, 0.5), dark)]
            return concatenate([*parts, lamps_and_plates(atlas, length + 0.02, 1.2, 0.85, generator)])
        parts.append(box((rear + 0.5 * body, 0, 0.95), (body, 2 * half, height - 0.95), load))
        parts.append(box((rear + 0.5 * body, 0, 0.6), (body, 1.0, 0.4), dark))
        if generator.random() < 0.7:
            art = Material(atlas.pick("art", generator))
            for side in (-1.0, 1.0):
                start = (rear + 0.3, side * (half + 0.01), 1.1)
                parts.append(rectangle(start, (body - 0.6, 0, 0), (0, 0, height - 1.3), art, unit_uv=True))
        for y in (-0.65, 0.65):
            parts.append(rectangle((rear - 0.015, y - 0.012, 1.0), (0, 0.024, 0), (0, 0, height - 1.1), dark))
        warning = Material(atlas.pick("paint", generator), (0.9, 0.3, 0.1), 0.0, 3.0)
        parts.append(rectangle((rear - 0.02, -1.1, 0.75), (0, 2.2, 0), (0, 0, 0.14), warning))
    parts.append(lamps_and_plates(atlas, length + 0.02, 1.2, 0.85, generator))
    return concatenate(parts)
