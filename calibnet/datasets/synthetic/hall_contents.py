"""Contents of the halls: vehicles in parking bays, shelves, calibration boards, people."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.random import Generator

from calibnet.datasets.synthetic import library
from calibnet.datasets.synthetic.mesh import Material, Mesh, box, concatenate, cylinder, rectangle
from calibnet.datasets.synthetic.textures import atlas
from calibnet.geometry.types import Floats, Transform

BAY = (2.5, 5.0)
"""Width and depth of a parking bay, metres."""


def material(generator: Generator, *groups: str, dark: float = 0.35, bright: float = 1.1) -> Material:
    """A random tile of these groups of the atlas, slightly tinted, as bright as ``dark`` to ``bright``."""
    value = float(generator.uniform(dark, bright))
    tint = value * np.exp(generator.normal(0.0, 0.05, 3))
    return Material(atlas().pick(str(generator.choice(groups)), generator), (tint[0], tint[1], tint[2]))


def parked(generator: Generator, size: Floats, edge: float, side: float) -> Iterator[Mesh]:
    """Markings of parking bays at right angles to the aisle, and vehicles in some of them."""
    width, depth = BAY
    paint = replace(material(generator, "paint", dark=0.6), reflectance=1.0)
    share = generator.uniform(0.1, 0.9)
    for x in np.arange(-0.5 * size[0] + 0.6, 0.5 * size[0] - width, width):
        yield rectangle((x, edge, 0.008), (0.1, 0.0, 0.0), (0.0, side * depth, 0.0), paint)
        if generator.random() < share:
            mesh, colour = library.pick_vehicle(
                "van" if size[2] > 2.9 and generator.random() < 0.1 else "car", generator
            )
            turn = 0.5 * np.pi * (1 if generator.random() < 0.5 else -1) + generator.normal(0.0, 0.03)
            at = (
                x + 0.5 * width + generator.normal(0.0, 0.1),
                edge + side * (0.5 * depth + generator.normal(0, 0.2)),
                0.0,
            )
            yield mesh.placed(at, turn, colour=colour)


def racks(generator: Generator, size: Floats, edge: float, side: float) -> Iterator[Mesh]:
    """Shelves with boxes, or boxes on the floor."""
    steel = Material(atlas().pick("metal", generator), tuple(generator.uniform(0.05, 0.7, 3)))
    levels = int(generator.integers(1, max(2, int(size[2] // 1.6))))
    for x in np.arange(-0.5 * size[0] + 1.0, 0.5 * size[0] - 3.0, generator.uniform(2.8, 3.6)):
        if generator.random() < 0.25:
            continue
        middle = edge + side * 1.4
        for level in range(levels):
            shelf = 1.5 * level + 0.1
            yield box((x + 1.3, middle, shelf - 0.1), (2.7, 1.1, 0.1), steel)
            for place in (0.45, 1.3, 2.15):
                if generator.random() < 0.7:
                    bulk = generator.uniform((0.4, 0.5, 0.3), (0.8, 1.0, 1.2))
                    surface = material(generator, "planks", "cloth", "plain", "art", dark=0.1)
                    yield box((x + place, middle + generator.normal(0, 0.08), shelf), tuple(bulk), surface)
        for post in (0.0, 2.65):
            yield box((x + post, middle - side * 0.55, 0.0), (0.08, 0.08, 1.5 * levels + 0.3), steel)


def boards(generator: Generator, place: Transform) -> Iterator[Mesh]:
    """Calibration boards and plain panels up to 5 m in front of the vehicle, on a stand or held by a person."""
    up = np.array([0.0, 0.0, 1.0])
    for _ in range(int(generator.choice([0, 1, 1, 2]))):
        away = np.array([generator.uniform(1.3, 5.0), generator.uniform(-1.5, 1.5), 0.0])
        foot = (place @ np.append(away, 1.0))[:3]
        forward = place[:3, 0]
        turn, roll = generator.normal(0.0, 0.35), float(generator.choice([0.0, 0.6, 0.8])) * generator.uniform(-1, 1)
        across = np.array([forward[1], -forward[0], 0.0]) * np.cos(turn) + forward * np.sin(turn)
        normal = np.cross(across, up)
        side, rise = np.cos(roll) * across + np.sin(roll) * up, np.cos(roll) * up - np.sin(roll) * across
        width, height = generator.uniform(0.5, 1.4), generator.uniform(0.4, 1.0)
        middle = foot + generator.uniform(0.5 * height + 0.3, 1.6) * up
        tone = float(generator.uniform(0.75, 1.0))
        white = Material(atlas().pick("plain", generator), (tone, tone, tone))
        corner = middle - 0.5 * width * side - 0.5 * height * rise
        yield rectangle(corner, width * side, height * rise, white)
        if generator.random() < 0.75:
            yield _squares(generator, corner - 0.004 * normal, width * side, height * rise)
            yield _squares(generator, corner + 0.004 * normal, width * side, height * rise)
        if generator.random() < 0.5:
            figure = library.pick("person", generator)
            yield figure.placed(
                foot + 0.35 * forward, generator.uniform(0, 6.3), colour=generator.uniform(0.02, 0.7, 3)
            )
        else:
            steel = material(generator, "metal", "black", dark=0.1)
            for leg in (-0.3, 0.0, 0.3):
                yield cylinder(foot + leg * across, middle + 0.05 * normal, 0.02, steel, 5)


def _squares(generator: Generator, corner: Floats, along: Floats, up: Floats) -> Mesh:
    """The black squares of a checkerboard with a margin."""
    columns, rows = int(generator.integers(5, 12)), int(generator.integers(4, 9))
    black = Material(atlas().pick("black", generator), (0.25, 0.25, 0.25))
    margin, step_x, step_y = 0.08, 0.84 / columns, 0.84 / rows
    squares = [
        rectangle(
            corner + (margin + i * step_x) * along + (margin + j * step_y) * up, step_x * along, step_y * up, black
        )
        for i in range(columns)
        for j in range(rows)
        if (i + j) % 2
    ]
    return concatenate(squares)


def people_and_things(
    generator: Generator, size: Floats, aisles: list[tuple[float, float]], place: Transform
) -> Iterator[Mesh]:
    """People, bins, cones and crates in the aisles, none within two metres of the vehicle."""
    for middle, width in aisles:
        for _ in range(int(generator.integers(2, 9))):
            at = np.array(
                [generator.uniform(-0.45, 0.45) * size[0], middle + generator.uniform(-0.45, 0.45) * width, 0.0]
            )
            name = str(generator.choice(["person", "bin", "bollard", "person"]))
            shape, turn = library.pick(name, generator), generator.uniform(0.0, 6.3)
            colour = generator.uniform(0.03, 0.7, 3)
            if np.linalg.norm(at - place[:3, 3]) > 2.0:
                yield shape.placed(at, turn, colour=colour)
