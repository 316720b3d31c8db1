"""Indoors: rooms, garages and warehouses, low or high, lit by lamps, with walls, pillars and a ceiling all around.

Almost all returns of a scanner on a car are below it or far away; indoors it has returns above its horizon, a few
metres away.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from calibnet.datasets.synthetic.hall_contents import BAY, boards, material, parked, people_and_things, racks
from calibnet.datasets.synthetic.mesh import Material, Mesh, box, concatenate, cylinder, patches, quads, rectangle
from calibnet.datasets.synthetic.textures import atlas
from calibnet.datasets.synthetic.weather import Weather
from calibnet.geometry import rotation_from_euler_xyz, transform
from calibnet.geometry.types import Floats, Transform

ROOM, GARAGE, WAREHOUSE = "room", "garage", "warehouse"
_PANEL = 1.5
"""Side of the panels of walls, floor and ceiling, metres; each is lit on its own."""
_BULB_HEIGHT = 0.08
"""Distance of lamps from the ceiling, metres."""


@dataclass(frozen=True, eq=False)
class Hall:
    """A hall with its contents, its light, and the pose of a vehicle in it.

    Attributes:
        kind: `ROOM`, `GARAGE` or `WAREHOUSE`.
        weather: its light, without sun; the sky is not visible.
        place: ``world_from_vehicle``, 4x4.
        everything: its triangles.
    """

    kind: str
    weather: Weather
    place: Transform
    everything: Mesh

    def mesh(self, world_from_vehicle: Transform, time: float, behind: float = 100.0, ahead: float = 120.0) -> Mesh:
        """The whole hall, wherever the vehicle is; nothing moves."""
        return self.everything


def sample_hall(generator: Generator) -> Hall:
    """Draw a hall with its contents."""
    kind = str(generator.choice([ROOM, GARAGE, WAREHOUSE], p=[0.3, 0.45, 0.25]))
    height = generator.uniform(4.0, 9.0) if kind == WAREHOUSE else generator.uniform(2.3, 3.6)
    aisle = generator.uniform(5.0, 7.5)
    rows = 1 if kind == ROOM or generator.random() < 0.5 else 2
    size = np.array([generator.uniform(18.0, 60.0), rows * (aisle + 2 * BAY[1]), height])
    if kind == ROOM:
        size[:2] = generator.uniform(7.0, 18.0, 2)
        aisle = size[1] - 3.0
    lamps = _lamps(generator, size)
    middles = [0.0] if rows == 1 else [-0.5 * aisle - BAY[1], 0.5 * aisle + BAY[1]]
    aisles = [(middle, aisle) for middle in middles]
    parts = [*_shell(generator, size), *_overhead(generator, size, lamps)]
    for middle, width in aisles:
        for side in (-1.0, 1.0):
            edge = middle + side * 0.5 * width
            if kind != ROOM:
                parts += _pillars(generator, size, edge)
            parts += parked(generator, size, edge, side) if kind == GARAGE else racks(generator, size, edge, side)
    place = _place(generator, size, aisles)
    parts += boards(generator, place)
    parts += people_and_things(generator, size, aisles, place)
    everything = _lit(concatenate(parts), lamps, generator)
    return Hall(kind, _light(generator), place, everything)


def _sheet(corner: Floats, along: Floats, up: Floats, material: Material) -> Mesh:
    """A rectangle divided into panels of `_PANEL`, so that its light can vary."""
    counts = [max(2, round(float(np.linalg.norm(edge)) / _PANEL)) for edge in (along, up)]
    share = [np.linspace(0.0, 1.0, count + 1) for count in counts]
    grid = corner + share[0][:, None, None] * along + share[1][None, :, None] * up
    lengths = np.linalg.norm(along), np.linalg.norm(up)
    uv = np.stack(np.meshgrid(share[0] * lengths[0], -share[1] * lengths[1], indexing="ij"), axis=-1)
    return quads(patches(grid), patches(uv), material)


def _shell(generator: Generator, size: Floats) -> Iterator[Mesh]:
    """Floor, ceiling and walls with doors and signs; walls are sometimes painted to breast height."""
    height = size[2]
    x, y, z = np.diag(size)
    corner = -0.5 * (x + y)
    floor = material(generator, "concrete", "concrete", "asphalt", "paint", dark=0.25)
    yield _sheet(corner, x, y, replace(floor, gloss=float(generator.choice([0.0, 0.0, 0.25, 0.5]))))
    yield _sheet(corner + z, x, y, material(generator, "concrete", "plaster", "metal"))
    wall = material(generator, "concrete", "plaster", "brick", "metal", dark=0.3)
    skirt = replace(material(generator, "paint"), tint=tuple(generator.uniform(0.05, 0.8, 3)))
    painted, breast = generator.random() < 0.4, generator.uniform(0.8, 1.4)
    for start, along in ((corner, x), (corner + x, y), (corner + x + y, -x), (corner + y, -y)):
        yield _sheet(start, along, z, wall)
        inwards = np.cross(z, along) / np.linalg.norm(np.cross(z, along))
        if painted:
            yield _sheet(start + 0.01 * inwards, along, z * breast / height, skirt)
        run = along / np.linalg.norm(along)
        for at in np.arange(3.0, float(np.linalg.norm(along)) - 3.0, 6.0) + generator.uniform(-2, 2):
            if generator.random() < 0.6:
                yield from _on_wall(generator, start + at * run + 0.03 * inwards, run, height)


def _on_wall(generator: Generator, foot: Floats, run: Floats, height: float) -> Iterator[Mesh]:
    """A door, a sign, a cabinet or a down pipe on a wall."""
    up, kind = np.array([0.0, 0.0, 1.0]), int(generator.integers(4))
    if kind == 0:
        tint = tuple(generator.uniform(0.03, 0.7, 3))
        door = Material(atlas().pick("metal", generator), tint)
        tall = min(generator.uniform(2.0, 3.0), height - 0.1)
        yield rectangle(foot, generator.choice([0.95, 1.9, 3.0]) * run, tall * up, door)
    elif kind == 1:
        face = Material(atlas().pick(str(generator.choice(["sign", "art"])), generator), reflectance=1.5)
        side = generator.uniform(0.4, 1.2)
        yield rectangle(foot + generator.uniform(1.0, height - side) * up, side * run, side * up, face, unit_uv=True)
    elif kind == 2:
        yield box(foot, (0.5, 0.5, generator.uniform(0.8, 1.9)), material(generator, "plain", "metal", dark=0.1))
    else:
        yield cylinder(
            foot, foot + height * up, generator.uniform(0.04, 0.12), material(generator, "metal", "plain"), 6
        )


def _lamps(generator: Generator, size: Floats) -> Floats:
    """Positions ``[L, 3]`` of the lamps that are on, in rows along x; some are missing."""
    length, width, height = size
    x = np.arange(-0.5 * length + 2.0, 0.5 * length - 1.0, generator.uniform(3.0, 8.0))
    y = np.arange(-0.5 * width + 2.5, 0.5 * width - 1.0, generator.uniform(4.0, 8.0))
    places = np.array([(a, b, height - _BULB_HEIGHT) for a in x for b in y])
    return places[generator.random(len(places)) < generator.uniform(0.5, 1.0)]


def _overhead(generator: Generator, size: Floats, lamps: Floats) -> Iterator[Mesh]:
    """Beams, pipes, ducts and lamps under the ceiling."""
    length, width, height = size
    beam = material(generator, "concrete", "metal")
    deep, wide = generator.uniform(0.15, 0.5), generator.uniform(0.15, 0.5)
    for x in np.arange(-0.5 * length + 1.0, 0.5 * length, generator.uniform(2.5, 8.0)):
        yield box((x, 0.0, height - deep), (wide, width, deep), beam)
    for _ in range(int(generator.integers(1, 6))):
        y, down = generator.uniform(-0.45, 0.45) * width, deep + generator.uniform(0.05, 0.3)
        pipe = material(generator, "metal", "plain", dark=0.1)
        ends = (-0.5 * length, y, height - down), (0.5 * length, y, height - down)
        if generator.random() < 0.3:
            yield box((0.0, y, height - down - 0.2), (length, generator.uniform(0.3, 0.9), 0.3), pipe)
        else:
            yield cylinder(*ends, generator.uniform(0.03, 0.15), pipe, 8)
    glow = Material(atlas().pick("lamp", generator), (6.0, 6.0, 5.6))
    tube = (1.4, 0.12, 0.06) if generator.random() < 0.7 else (0.5, 0.5, 0.08)
    for lamp in lamps:
        yield box(lamp - (0, 0, generator.uniform(0.0, 0.02)), tube, glow)


def _pillars(generator: Generator, size: Floats, edge: float) -> Iterator[Mesh]:
    """A row of pillars along an aisle, sometimes with bands."""
    if generator.random() < 0.15:
        return
    body, thick = material(generator, "concrete", "plaster", "metal"), generator.uniform(0.25, 0.7)
    band = replace(material(generator, "paint"), tint=tuple(generator.uniform(0.05, 0.9, 3)))
    banded, round_ = generator.random() < 0.5, generator.random() < 0.3
    for x in np.arange(-0.5 * size[0] + 2.0, 0.5 * size[0] - 1.0, 2 * BAY[0] * int(generator.integers(1, 3))):
        if round_:
            yield cylinder((x, edge, 0.0), (x, edge, size[2]), 0.5 * thick, body, 12)
        else:
            yield box((x, edge, 0.0), (thick, thick, size[2]), body)
        if banded:
            yield box((x, edge, 0.4), (thick + 0.02, thick + 0.02, generator.uniform(0.3, 1.0)), band)


def _place(generator: Generator, size: Floats, aisles: list[tuple[float, float]]) -> Transform:
    """``world_from_vehicle`` in an aisle, looking along it or, more rarely, anywhere."""
    middle, width = aisles[int(generator.integers(len(aisles)))]
    x = generator.uniform(-0.5, 0.2) * (size[0] - min(8.0, 0.6 * size[0]))
    yaw = generator.normal(0.0, 0.15) if generator.random() < 0.7 else generator.uniform(-1.2, 1.2)
    position = [x, middle + generator.uniform(-0.25, 0.25) * width, 0.0]
    turned = rotation_from_euler_xyz([0.0, 0.0, yaw])
    if generator.random() < 0.5:
        turned, position[0] = rotation_from_euler_xyz([0.0, 0.0, yaw + np.pi]), -x
    return transform(turned, position)


def _lit(mesh: Mesh, lamps: Floats, generator: Generator) -> Mesh:
    """Tint every triangle by its light: that of the lamps, by distance, and ambient light."""
    middle = mesh.corners.mean(axis=1)
    light: NDArray[np.float32] = np.zeros(len(middle), np.float32)
    for lamp in lamps.astype(np.float32):
        light += 1.0 / (1.0 + ((middle - lamp) ** 2).sum(axis=1))
    share = float(generator.uniform(0.0, 0.9))
    light = light / max(float(np.median(light)), 1e-6) if len(lamps) else np.ones_like(light)
    factor = (1.0 - share) + share * np.minimum(light, 6.0)
    shining = mesh.tint.max(axis=1) > 3.0
    return replace(mesh, tint=np.where(shining[:, None], mesh.tint, mesh.tint * factor[:, None]))


def _light(generator: Generator) -> Weather:
    """Ambient light, warm or cold."""
    warm = np.exp(generator.normal(0.0, 0.12))
    tone = np.array([warm, 1.0, 1.0 / warm], dtype=np.float32)
    ambient = (tone * generator.uniform(0.5, 1.0)).astype(np.float32)
    zero = np.zeros(3, dtype=np.float32)
    return Weather(
        sun_direction=np.array([0.0, 0.0, 1.0], dtype=np.float32),
        sun=zero,
        zenith=ambient,
        horizon=0.3 * ambient,
        ambient=ambient,
        bounce=(ambient * np.float32(generator.uniform(0.2, 0.9))).astype(np.float32),
        clouds=1.0,
        cloud_shift=np.zeros(2, dtype=np.float32),
        visibility=2500.0,
    )
