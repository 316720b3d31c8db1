"""Cars, vans and bicycles; x forward, standing on z = 0, painted triangles take the instance's colour."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.random import Generator

from calibnet.datasets.synthetic.bodywork import Rib, contact_shadow, hull, lamps_and_plates, wheels
from calibnet.datasets.synthetic.mesh import Material, Mesh, box, concatenate, cylinder, quads, rectangle
from calibnet.datasets.synthetic.textures import Atlas


@dataclass(frozen=True)
class _CarKind:
    """Dimensions of a kind of car.

    Attributes:
        shorter: metres subtracted from the length.
        taller: metres added to the height.
        clearance: height of the body above the ground, metres.
        boot: share of the length behind the rear window.
        tail_drop: drop of the boot lid or tailgate towards the rear, metres.
        rear_slope: range of the rear window's horizontal run, metres.
    """

    shorter: float = 0.0
    taller: float = 0.0
    clearance: float = 0.20
    boot: float = 0.03
    tail_drop: float = 0.06
    rear_slope: tuple[float, float] = (0.15, 0.35)


_CAR_KINDS = (
    _CarKind(boot=0.16, tail_drop=0.02, rear_slope=(0.5, 0.7)),  # saloon
    _CarKind(shorter=0.3),  # hatchback
    _CarKind(),  # estate
    _CarKind(taller=0.22, clearance=0.32),  # off-roader
)
_CAR_BODY = (
    Rib("front", 0.00, 0.86, 0.14, "nose", -0.12, 0.95),
    Rib("front", -0.10, 0.94, 0.02, "nose", 0.00, 0.93),
    Rib("bonnet", 0.00, 1.00, 0.00, "belt", 0.00, 0.93),
    Rib("boot", 0.15, 1.00, 0.00, "belt", 0.02, 0.93),
    Rib("rear", 0.08, 0.95, 0.05, "tail", 0.00, 0.93),
    Rib("rear", 0.00, 0.88, 0.20, "tail", -0.15, 0.95),
)
_CAR_POSTS = ((1.0, 0.0, 0.07), (0.45, 0.55, 0.10), (0.0, 1.0, 0.16))
"""Posts of a car's roof: weights of the positions of windscreen and rear window, and width in metres."""
_VAN_BODY = (
    Rib("front", 0.00, 0.90, 0.30, "ground", 0.95, 0.95),
    Rib("front", -0.55, 1.00, 0.22, "ground", 1.15, 0.92),
    Rib("front", -1.25, 1.00, 0.22, "roof", -0.05, 0.90),
    Rib("front", -1.60, 1.00, 0.22, "roof", 0.00, 0.92),
    Rib("rear", 0.00, 1.00, 0.25, "roof", 0.00, 0.92),
)


def car(atlas: Atlas, generator: Generator) -> Mesh:
    """A saloon, hatchback, estate or off-roader."""
    kind = _CAR_KINDS[int(generator.integers(len(_CAR_KINDS)))]
    length = generator.uniform(3.7, 4.9) - kind.shorter
    half, height = generator.uniform(0.82, 0.95), generator.uniform(1.40, 1.58) + kind.taller
    front, rear, belt, clearance = 0.5 * length, -0.5 * length, 0.60 * height, kind.clearance
    bonnet, boot = front - generator.uniform(0.20, 0.27) * length, rear + kind.boot * length
    paint = Material(atlas.pick("metal", generator), gloss=0.55, reflectance=0.9, paint=True)
    glass = Material(atlas.pick("glass", generator), gloss=0.9)
    trim = Material(atlas.pick("black", generator))
    nose, tail = belt - generator.uniform(0.12, 0.25), belt - kind.tail_drop
    marks = {"front": front, "bonnet": bonnet, "boot": boot, "rear": rear, "nose": nose, "belt": belt, "tail": tail}
    half_roof = generator.uniform(0.66, 0.76) * half
    foot, rear_foot = bonnet + 0.05, boot + 0.08
    windscreen = (foot, bonnet - generator.uniform(0.55, 0.85))
    rear_window = (rear_foot, rear_foot + generator.uniform(*kind.rear_slope))
    parts = [
        hull(_CAR_BODY, marks, half, clearance, paint),
        *_cabin(windscreen, rear_window, (0.88 * half, half_roof), (belt, height), glass, paint),
        wheels(atlas, (front - 0.19 * length, rear + 0.19 * length), half, generator.uniform(0.30, 0.36), generator),
        lamps_and_plates(atlas, length, half, clearance + 0.38, generator),
        box((0, 0, 0.10), (0.8 * length, 1.5 * half, clearance), trim),
        contact_shadow(atlas, length, half),
    ]
    seam = Material(trim.texture, (0.6, 0.6, 0.6))
    for side in (-1.0, 1.0):
        parts.append(box((foot - 0.15, side * (half + 0.08), belt), (0.12, 0.18, 0.14), paint))  # the mirror
        for x in (foot - 0.1, 0.5 * (foot + rear_foot), rear_foot + 0.25):  # of the doors
            lower = (x, side * (half + 0.004), clearance + 0.2)
            parts.append(rectangle(lower, (0.015, 0, 0), (0, 0, belt - clearance - 0.3), seam))
    return concatenate(parts)


def _cabin(
    windscreen: tuple[float, float],
    rear_window: tuple[float, float],
    half_width: tuple[float, float],
    height: tuple[float, float],
    glass: Material,
    paint: Material,
) -> list[Mesh]:
    """The part of a car above its belt line: windows all round, the roof, and the posts between.

    Each pair says where the lower and the upper edge are, in metres: of the windscreen and the rear
    window along the car, of the side windows from the middle, of all above the ground.
    """
    (x0, x1), (x3, x2), (foot, roof), (belt, top) = windscreen, rear_window, half_width, height
    low = [(x0, foot, belt - 0.01), (x3, foot, belt), (x3, -foot, belt), (x0, -foot, belt - 0.01)]
    high = [(x1, roof, top), (x2, roof, top - 0.02), (x2, -roof, top - 0.02), (x1, -roof, top)]
    windows = [[low[i], low[(i + 1) % 4], high[(i + 1) % 4], high[i]] for i in range(4)]
    posts = []
    for side in (1.0, -1.0):
        y0, y1 = side * (foot + 0.008), side * (roof + 0.008)
        for ahead, behind, width in _CAR_POSTS:
            a, b = ahead * x0 + behind * x3, ahead * x1 + behind * x2
            inward = width if a < 0 else -width
            posts.append([(a, y0, belt), (a + inward, y0, belt), (b + inward, y1, top), (b, y1, top)])
        edge, inner = side * (roof + 0.01), side * roof
        posts.append([(x1, edge, top - 0.07), (x2, edge, top - 0.09), (x2, inner, top), (x1, inner, top)])
    return [
        quads(windows, [[(0, 0), (2, 0), (2, 0.5), (0, 0.5)]] * 4, glass),
        quads([high], [[(0, 0), (2, 0), (2, 1), (0, 1)]], paint),
        quads(posts, np.zeros((len(posts), 4, 2)), paint),
    ]


def van(atlas: Atlas, generator: Generator) -> Mesh:
    """A panel van, often with lettering."""
    length, half, height = generator.uniform(4.6, 6.2), generator.uniform(0.92, 1.05), generator.uniform(1.9, 2.6)
    front, rear = 0.5 * length, -0.5 * length
    paint = Material(atlas.pick("metal", generator), gloss=0.4, reflectance=0.9, paint=True)
    glass = Material(atlas.pick("glass", generator), gloss=0.9)
    marks = {"front": front, "rear": rear, "ground": 0.0, "roof": height}
    foot, top = front - 0.5 + 0.06, front - 1.25 + 0.06
    low, high = 1.13 + 0.05, height - 0.18 + 0.05
    windscreen = [
        (foot, 0.85 * half, low),
        (foot, -0.85 * half, low),
        (top, -0.78 * half, high),
        (top, 0.78 * half, high),
    ]
    parts = [hull(_VAN_BODY, marks, half, 0.0, paint), quads([windscreen], np.zeros((1, 4, 2)), glass)]
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
