"""Lorries, tankers and buses; x forward, standing on z = 0."""

from __future__ import annotations

from typing import NamedTuple

from numpy.random import Generator

from calibnet.datasets.synthetic.bodywork import Rib, contact_shadow, hull, lamps_and_plates, wheels
from calibnet.datasets.synthetic.mesh import Material, Mesh, box, concatenate, cylinder, rectangle
from calibnet.datasets.synthetic.textures import Atlas

_HALF = 1.25
"""Half the width of all lorries and buses, metres."""
_BUS_BODY = (
    Rib("front", 0.00, 0.92, 0.40, "roof", -0.1, 0.95),
    Rib("front", -0.30, 1.00, 0.35, "roof", 0.0, 0.96),
    Rib("rear", 0.00, 1.00, 0.35, "roof", 0.0, 0.96),
)


class _Materials(NamedTuple):
    paint: Material
    glass: Material
    dark: Material


def lorry(atlas: Atlas, generator: Generator) -> Mesh:
    """A lorry with a box body or container, a tanker, or a bus."""
    bus = generator.random() < 0.3
    length = generator.uniform(10.0, 12.0) if bus else generator.uniform(7.0, 14.0)
    height = generator.uniform(2.9, 3.3) if bus else generator.uniform(3.2, 3.9)
    materials = _Materials(
        paint=Material(atlas.pick("metal", generator), gloss=0.35, reflectance=0.9, paint=True),
        glass=Material(atlas.pick("glass", generator), gloss=0.9),
        dark=Material(atlas.pick("black", generator)),
    )
    axles = (0.5 * length - 1.3, -0.5 * length + 1.4, -0.5 * length + 2.5)
    parts = [wheels(atlas, axles, _HALF - 0.02, 0.48, generator), contact_shadow(atlas, length, _HALF)]
    if bus:
        parts += _bus_body(length, height, materials)
    else:
        parts += _cab(0.5 * length, generator.uniform(2.5, 3.4), materials)
        load = Material(atlas.pick(str(generator.choice(["plain", "metal", "planks"])), generator), paint=True)
        if generator.random() < 0.2:
            parts += _tank(length, height, load, materials.dark)
        else:
            parts += _container(atlas, length, height, load, materials.dark, generator)
    parts.append(lamps_and_plates(atlas, length + 0.02, 1.2, 0.85, generator))
    return concatenate(parts)


def _bus_body(length: float, height: float, materials: _Materials) -> list[Mesh]:
    front, rear, glass = 0.5 * length, -0.5 * length, materials.glass
    parts = [hull(_BUS_BODY, {"front": front, "rear": rear, "roof": height}, _HALF, 0.0, materials.paint)]
    for side in (-1.0, 1.0):
        for pane in range(int(length // 1.4)):
            corner = (rear + 0.4 + 1.4 * pane, side * (_HALF + 0.01), 1.3)
            parts.append(rectangle(corner, (1.28, 0, 0), (0, 0, 0.95), glass))
    parts.append(rectangle((front + 0.01, -1.0, 1.2), (0, 2.0, 0), (0, 0, 1.4), glass))
    parts.append(rectangle((rear - 0.01, -0.9, 1.6), (0, 1.8, 0), (0, 0, 0.8), glass))
    return parts


def _cab(front: float, height: float, materials: _Materials) -> list[Mesh]:
    parts = [
        box((front - 0.95, 0, 0.5), (1.9, 2.3, height - 0.5), materials.paint),
        rectangle((front + 0.01, -1.05, 1.5), (0, 2.1, 0), (0, 0, 0.85), materials.glass),
        rectangle((front + 0.01, -0.9, 0.7), (0, 1.8, 0), (0, 0, 0.6), materials.dark),
    ]
    for side in (-1.0, 1.0):
        parts.append(rectangle((front - 1.3, side * 1.16, 1.5), (0.9, 0, 0), (0, 0, 0.75), materials.glass))
    return parts


def _tank(length: float, height: float, load: Material, dark: Material) -> list[Mesh]:
    rear, body = -0.5 * length, length - 2.3
    steel = Material(load.texture, (0.8, 0.8, 0.82), 0.3)
    middle, radius = 0.5 * height + 0.5, 0.5 * height - 0.5
    tank = cylinder((rear, 0, middle), (rear + body - 0.3, 0, middle), radius, steel, 16)
    return [tank, box((rear + 0.5 * body, 0, 0.6), (body, 1.0, 0.5), dark)]


def _container(
    atlas: Atlas, length: float, height: float, load: Material, dark: Material, generator: Generator
) -> list[Mesh]:
    """A box body, often with lettering, with the rods of its doors and a warning strip at the rear."""
    rear, body = -0.5 * length, length - 2.3
    parts = [
        box((rear + 0.5 * body, 0, 0.95), (body, 2 * _HALF, height - 0.95), load),
        box((rear + 0.5 * body, 0, 0.6), (body, 1.0, 0.4), dark),
    ]
    if generator.random() < 0.7:
        art = Material(atlas.pick("art", generator))
        for side in (-1.0, 1.0):
            corner = (rear + 0.3, side * (_HALF + 0.01), 1.1)
            parts.append(rectangle(corner, (body - 0.6, 0, 0), (0, 0, height - 1.3), art, unit_uv=True))
    for y in (-0.65, 0.65):
        parts.append(rectangle((rear - 0.015, y - 0.012, 1.0), (0, 0.024, 0), (0, 0, height - 1.1), dark))
    warning = Material(atlas.pick("paint", generator), (0.9, 0.3, 0.1), 0.0, 3.0)
    parts.append(rectangle((rear - 0.02, -1.1, 0.75), (0, 2.2, 0), (0, 0, 0.14), warning))
    return parts
