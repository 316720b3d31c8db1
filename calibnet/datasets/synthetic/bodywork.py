"""Parts of all vehicles: a hull of cross-sections, wheels, lamps, number plates, a contact shadow."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.random import Generator

from calibnet.datasets.synthetic.mesh import Material, Mesh, concatenate, loft, quads, rectangle, triangles
from calibnet.datasets.synthetic.textures import Atlas


class Rib(NamedTuple):
    """An octagonal cross-section of a hull, relative to named positions and heights (marks) of the vehicle.

    Attributes:
        mark: name of the mark that gives its position along the vehicle.
        ahead: distance ahead of that mark, metres.
        width: half width, as a share of the vehicle's half width.
        bottom: height of its lower side above the vehicle's clearance, metres.
        top: name of the mark that gives the height of its upper side.
        above: height above that mark, metres.
        taper: width of the upper side, as a share of the width.
    """

    mark: str
    ahead: float
    width: float
    bottom: float
    top: str
    above: float
    taper: float


def hull(
    ribs: Sequence[Rib], marks: Mapping[str, float], half_width: float, clearance: float, material: Material
) -> Mesh:
    """A closed skin over ribs from the front to the rear.

    Args:
        ribs: the cross-sections in order.
        marks: positions (metres ahead of the vehicle's middle) and heights, by the names that ribs use.
        half_width: half the width of the vehicle, metres.
        clearance: height of the lowest rib above the ground, metres.
        material: material of the skin.
    """
    rings = []
    for rib in ribs:
        x, lower, upper = marks[rib.mark] + rib.ahead, clearance + rib.bottom, marks[rib.top] + rib.above
        rings.append(_octagon(x, rib.width * half_width, lower, upper, rib.taper))
    return loft(rings, material)


def _octagon(x: float, half_width: float, lower: float, upper: float, taper: float) -> list[tuple[float, float, float]]:
    """Corners of a cross-section at ``x``, from the lower right over the top to the lower left."""
    height, half_top = upper - lower, half_width * taper
    right = [
        (x, 0.90 * half_width, lower),
        (x, half_width, lower + 0.3 * height),
        (x, 0.5 * (half_width + half_top), lower + 0.75 * height),
        (x, 0.88 * half_top, upper),
    ]
    return right + [(x, -y, z) for _, y, z in reversed(right)]


def wheels(atlas: Atlas, axles: tuple[float, ...], half_width: float, radius: float, generator: Generator) -> Mesh:
    """Wheels and their dark arches on both sides of the axles at ``x``."""
    rubber = Material(atlas.pick("black", generator), reflectance=0.6)
    face = Material(atlas.pick("wheel", generator))
    sides = 12
    angle = np.linspace(0.0, 2.0 * np.pi, sides, endpoint=False)
    circle = np.stack([np.cos(angle), np.zeros(sides), np.sin(angle)], axis=1)
    after = np.roll(circle, -1, axis=0)
    disc = np.stack([np.zeros_like(circle), circle, after], axis=1)
    disc_uv = 0.5 + 0.5 * disc[..., [0, 2]]
    upper = disc[: sides // 2 + 1]
    parts = []
    for x in axles:
        for side in (-1.0, 1.0):
            outer = side * (half_width + 0.02)
            hub = np.array([x, outer, radius])
            tread = np.stack([circle, after, after, circle], axis=1) * radius + hub
            tread[:, 2:, 1] -= side * 0.2
            parts.append(quads(tread, np.zeros((sides, 4, 2)), rubber))
            parts.append(triangles(disc * radius + hub, disc_uv, face))
            arch = upper * 1.22 * radius + hub - (0.0, side * 0.014, 0.0)
            parts.append(triangles(arch, upper[..., [0, 2]], rubber))
    return concatenate(parts)


def contact_shadow(atlas: Atlas, length: float, half_width: float) -> Mesh:
    """The dark ground under a vehicle, which no skylight reaches."""
    dark = Material(atlas.groups["asphalt"][0], (0.25, 0.25, 0.25))
    origin = (-0.49 * length, -0.97 * half_width, 0.035)
    return rectangle(origin, (0.98 * length, 0, 0), (0, 1.94 * half_width, 0), dark)


class _End(NamedTuple):
    """Lamps, number plate and grille of one end of a vehicle.

    Attributes:
        direction: 1 for the front, -1 for the rear.
        lamp: tint of the lamps; ``lamp_height`` the range of their height, metres; ``lamp_retro`` their reflectance.
        plate: tint of the number plate.
        grille: dark panels: half width, height above the lamps' lower edge, and height of each, metres.
    """

    direction: float
    lamp: tuple[float, float, float]
    lamp_height: tuple[float, float]
    lamp_retro: float
    plate: tuple[float, float, float]
    grille: tuple[tuple[float, float, float], ...]


_ENDS = (
    _End(1.0, (1.0, 1.0, 0.95), (0.12, 0.22), 1.0, (1.0, 0.95, 0.85), ((0.45, -0.05, 0.16), (0.6, -0.32, 0.14))),
    _End(-1.0, (0.75, 0.05, 0.04), (0.15, 0.35), 2.5, (1.0, 0.9, 0.6), ()),
)


def lamps_and_plates(atlas: Atlas, length: float, half_width: float, height: float, generator: Generator) -> Mesh:
    """Head and tail lamps from ``height`` upwards, retro-reflective number plates, a grille."""
    lamp, paint = atlas.pick("lamp", generator), atlas.pick("paint", generator)
    parts = []
    for end in _ENDS:
        x = (0.5 * length + 0.012) * end.direction
        w, h = generator.uniform(0.25, 0.42), generator.uniform(*end.lamp_height)
        glow = Material(lamp, end.lamp, 0.3, end.lamp_retro)
        for side in (-1.0, 1.0):
            y = side * (0.85 * half_width - 0.5 * w) - 0.5 * w
            parts.append(rectangle((x, y, height), (0, w, 0), (0, 0, h), glow))
        plate = Material(paint, end.plate, 0.0, 3.0)
        parts.append(rectangle((x, -0.26, height - 0.22), (0, 0.52, 0), (0, 0, 0.12), plate))
        if end.grille:
            dark = Material(atlas.pick("black", generator))
            for half, above, tall in end.grille:
                parts.append(rectangle((x - 0.005, -half, height + above), (0, 2.0 * half, 0), (0, 0, tall), dark))
    return concatenate(parts)
