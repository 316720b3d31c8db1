"""Cars, vans and bicycles; x forward, standing on z = 0, painted triangles take the instance's colour."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from calibnet.datasets.synthetic.mesh import (
    Material,
    Mesh,
    box,
    concatenate,
    cylinder,
    loft,
    quads,
    rectangle,
    triangles,
)
from calibnet.datasets.synthetic.textures import Atlas

Generator = np.random.Generator


def cross_section(
    x: float, half_width: float, bottom: float, top: float, taper: float
) -> list[tuple[float, float, float]]:
    """An octagonal cross-section of a body at ``x``; ``taper`` narrows its top."""
    height, upper = top - bottom, half_width * taper
    right = [
        (x, 0.90 * half_width, bottom),
        (x, half_width, bottom + 0.3 * height),
        (x, 0.5 * (half_width + upper), bottom + 0.75 * height),
        (x, 0.88 * upper, top),
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
    """The dark ground under a vehicle, where no skylight reaches."""
    dark = Material(atlas.groups["asphalt"][0], (0.25, 0.25, 0.25))
    origin = (-0.49 * length, -0.97 * half_width, 0.035)
    return rectangle(origin, (0.98 * length, 0, 0), (0, 1.94 * half_width, 0), dark)


def lamps_and_plates(atlas: Atlas, length: float, half_width: float, height: float, generator: Generator) -> Mesh:
    """Head and tail lamps, retro-reflective number plates, a grille."""
    lamp, paint = atlas.pick("lamp", generator), atlas.pick("paint", generator)
    parts = []
    for front in (True, False):
        x = (0.5 * length + 0.012) * (1 if front else -1)
        tint = (1.0, 1.0, 0.95) if front else (0.75, 0.05, 0.04)
        w, h = generator.uniform(0.25, 0.42), generator.uniform(0.12, 0.22) if front else generator.uniform(0.15, 0.35)
        for side in (-1.0, 1.0):
            y = side * (0.85 * half_width - 0.5 * w) - 0.5 * w
            retro = 1.0 if front else 2.5
            parts.append(rectangle((x, y, height), (0, w, 0), (0, 0, h), Material(lamp, tint, 0.3, retro)))
        plate = Material(paint, (1.0, 0.95, 0.85) if front else (1.0, 0.9, 0.6), 0.0, 3.0)
        parts.append(rectangle((x, -0.26, height - 0.22), (0, 0.52, 0), (0, 0, 0.12), plate))
        if front:
            grille = Material(atlas.pick("black", generator))
            parts.append(rectangle((x - 0.005, -0.45, height - 0.05), (0, 0.9, 0), (0, 0, 0.16), grille))
            parts.append(rectangle((x - 0.005, -0.6, height - 0.32), (0, 1.2, 0), (0, 0, 0.14), grille))
    return concatenate(parts)


def car(atlas: Atlas, generator: Generator) -> Mesh:
    """A saloon, hatchback, estate or off-roader."""
    style = int(generator.integers(4))
    length = generator.uniform(3.7, 4.9) - (0.3 if style == 1 else 0.0)
    half, height = generator.uniform(0.82, 0.95), generator.uniform(1.40, 1.58) + (0.22 if style == 3 else 0.0)
    clearance, belt = (0.32 if style == 3 else 0.2), 0.60 * height
    front, rear = 0.5 * length, -0.5 * length
    bonnet = generator.uniform(0.20, 0.27) * length
    boot = (0.16 if style == 0 else 0.03) * length
    paint = Material(atlas.pick("metal", generator), gloss=0.55, reflectance=0.9, paint=True)
    glass = Material(atlas.pick("glass", generator), gloss=0.9, reflectance=1.0)
    trim = Material(atlas.pick("black", generator))
    nose, tail = belt - generator.uniform(0.12, 0.25), belt - (0.06 if style else 0.02)
    body = loft(
        [
            cross_section(front, 0.86 * half, clearance + 0.14, nose - 0.12, 0.95),
            cross_section(front - 0.10, 0.94 * half, clearance + 0.02, nose, 0.93),
            cross_section(front - bonnet, half, clearance, belt, 0.93),
            cross_section(rear + boot + 0.15, half, clearance, belt + 0.02, 0.93),
            cross_section(rear + 0.08, 0.95 * half, clearance + 0.05, tail, 0.93),
            cross_section(rear, 0.88 * half, clearance + 0.2, tail - 0.15, 0.95),
        ],
        paint,
    )
    foot, roof = 0.88 * half, generator.uniform(0.66, 0.76) * half
    x0, x1 = front - bonnet + 0.05, front - bonnet - generator.uniform(0.55, 0.85)
    x3 = rear + boot + 0.08
    x2 = x3 + (generator.uniform(0.5, 0.7) if style == 0 else generator.uniform(0.15, 0.35))
    low = [(x0, foot, belt - 0.01), (x3, foot, belt), (x3, -foot, belt), (x0, -foot, belt - 0.01)]
    high = [(x1, roof, height), (x2, roof, height - 0.02), (x2, -roof, height - 0.02), (x1, -roof, height)]
    sides = [[low[i], low[(i + 1) % 4], high[(i + 1) % 4], high[i]] for i in range(4)]
    cabin = quads(sides, [[(0, 0), (2, 0), (2, 0.5), (0, 0.5)]] * 4, glass)
    top = quads([high], [[(0, 0), (2, 0), (2, 1), (0, 1)]], paint)
    pillars = []
    for side in (1.0, -1.0):
        for a, b, w in ((x0, x1, 0.07), (0.45 * x0 + 0.55 * x3, 0.45 * x1 + 0.55 * x2, 0.1), (x3, x2, 0.16)):
            y0, y1 = side * (foot + 0.008), side * (roof + 0.008)
            inward = 1.0 if a < 0 else -1.0
            post = [(a, y0, belt), (a + inward * w, y0, belt), (b + inward * w, y1, height), (b, y1, height)]
            pillars.append(post)
        pillars.append(
            [
                (x1, side * (roof + 0.01), height - 0.07),
                (x2, side * (roof + 0.01), height - 0.09),
                (x2, side * roof, height),
                (x1, side * roof, height),
            ]
        )
    posts = quads(pillars, np.zeros((len(pillars), 4, 2)), paint)
    parts = [
        body,
        cabin,
        top,
        posts,
        wheels(atlas, (front - 0.19 * length, rear + 0.19 * length), half, generator.uniform(0.30, 0.36), generator),
        lamps_and_plates(atlas, length, half, clearance + 0.38, generator),
        box((0, 0, 0.10), (0.8 * length, 1.5 * half, clearance), trim),
        contact_shadow(atlas, length, half),
    ]
    for side in (-1.0, 1.0):
        parts.append(box((x0 - 0.15, side * (half + 0.08), belt), (0.12, 0.18, 0.14), paint))
        seam = Material(trim.texture, (0.6, 0.6, 0.6))
        for x in (x0 - 0.1, 0.5 * (x0 + x3), x3 + 0.25):
            parts.append(
                rectangle(
                    (x, side * (half + 0.004), clearance + 0.2), (0.015, 0, 0), (0, 0, belt - clearance - 0.3), seam
                )
            )
    return concatenate(parts)


def van(atlas: Atlas, generator: Generator) -> Mesh:
    """A panel van, often with lettering."""
    length, half, height = generator.uniform(4.6, 6.2), generator.uniform(0.92, 1.05), generator.uniform(1.9, 2.6)
    front, rear = 0.5 * length, -0.5 * length
    paint = Material(atlas.pick("metal", generator), gloss=0.4, reflectance=0.9, paint=True)
    glass = Material(atlas.pick("glass", generator), gloss=0.9)
    body = loft(
        [
            cross_section(front, 0.9 * half, 0.3, 0.95, 0.95),
            cross_section(front - 0.55, half, 0.22, 1.15, 0.92),
            cross_section(front - 1.25, half, 0.22, height - 0.05, 0.9),
            cross_section(front - 1.6, half, 0.22, height, 0.92),
            cross_section(rear, half, 0.25, height, 0.92),
        ],
        paint,
    )
    shield = [
        (front - 0.5, 0.85 * half, 1.13),
        (front - 0.5, -0.85 * half, 1.13),
        (front - 1.25, -0.78 * half, height - 0.18),
        (front - 1.25, 0.78 * half, height - 0.18),
    ]
    shield = [(x + 0.06, y, z + 0.05) for x, y, z in shield]
    parts = [body, quads([shield], np.zeros((1, 4, 2)), glass)]
    for side in (-1.0, 1.0):
        y = side * (half + 0.01)
        parts.append(rectangle((front - 2.0, y, 1.15), (0.8, 0, 0), (0, 0, 0.55), glass))
        if generator.random() < 0.6:
            art = Material(atlas.pick("art", generator))
            parts.append(rectangle((rear + 0.3, y, 0.8), (length - 2.6, 0, 0), (0, 0, height - 1.4), art, unit_uv=True))
    parts.append(rectangle((rear - 0.01, -0.7 * half, 1.2), (0, 1.4 * half, 0), (0, 0, 0.5), glass))
    parts.append(wheels(atlas, (front - 0.9, rear + 0.95), half, 0.34, generator))
    parts.append(contact_shadow(atlas, length, half))
    parts.append(lamps_and_plates(atlas, length, half, 0.75, generator))
    return concatenate(parts)


def bicycle(atlas: Atlas, generator: Generator) -> Mesh:
    """A bicycle or scooter."""
    dark, frame = Material(atlas.pick("black", generator)), Material(atlas.pick("metal", generator), paint=True)
    parts = []
    for x in (-0.52, 0.52):
        angle = np.linspace(0.0, 2.0 * np.pi, 11)
        rim = np.stack([x + 0.33 * np.cos(angle), np.zeros(11), 0.34 + 0.33 * np.sin(angle)], 1)
        parts += [cylinder(a, b, 0.025, dark, 4) for a, b in pairwise(rim)]
    for a, b in (
        ((-0.52, 0, 0.34), (-0.15, 0, 0.85)),
        ((-0.15, 0, 0.4), (0.4, 0, 0.8)),
        ((-0.15, 0, 0.4), (-0.52, 0, 0.34)),
        ((0.52, 0, 0.34), (0.4, 0, 0.95)),
        ((0.4, -0.28, 1.0), (0.4, 0.28, 1.0)),
    ):
        parts.append(cylinder(a, b, 0.03, frame, 4))
    return concatenate([*parts, box((-0.17, 0, 0.85), (0.25, 0.14, 0.07), dark)])
