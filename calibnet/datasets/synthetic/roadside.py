"""Objects between the carriageway and the plots: parked cars, street furniture, people."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from calibnet.datasets.synthetic import library
from calibnet.datasets.synthetic.mesh import Mesh
from calibnet.datasets.synthetic.stretch import Stretch

Facing = Literal["traffic", "road", "any"]


@dataclass(frozen=True)
class Furniture:
    """A kind of street furniture and how it is placed.

    Attributes:
        name: name of the prototypes.
        probability: probability that a side of a chunk has one if ``Style.furniture`` is 1.
        distance: metres outwards from the line where furniture starts, times a random 0.5 to 1.2.
        facing: along the traffic, towards the road, or any way.
        row: smallest and largest number in a row.
    """

    name: str
    probability: float
    distance: float
    facing: Facing = "traffic"
    row: tuple[int, int] = (1, 1)


_FURNITURE = (
    Furniture("lamp_post", 0.50, 0.0, facing="road"),
    Furniture("sign", 0.55, 0.1),
    Furniture("pole", 0.15, 0.3),
    Furniture("bollard", 0.25, 0.0, row=(2, 6)),
    Furniture("bin", 0.30, 1.0, facing="any"),
    Furniture("traffic_light", 0.12, 0.1),
    Furniture("billboard", 0.08, 2.0),
    Furniture("bench", 0.08, 1.2, facing="any"),
    Furniture("bicycle", 0.20, 1.0, facing="any"),
)
"""Kinds of furniture. The scene of a seed depends on their order."""
_SPACING = 1.6
"""Distance between the pieces of a row, metres."""
_SLOT = 6.2
"""Length of road that a parked vehicle takes, metres."""


def roadside(stretch: Stretch) -> list[Mesh]:
    """Parked vehicles, street furniture, pedestrians and a cyclist of one side."""
    parts = _parked(stretch)
    for kind in _FURNITURE:
        if stretch.generator.random() < kind.probability * stretch.scene.style.furniture:
            parts += _furniture(stretch, kind)
    return parts + _pedestrians(stretch) + _cyclist(stretch)


def _parked(stretch: Stretch) -> list[Mesh]:
    """Vehicles in the parking strip or, without one, with two wheels on the pavement."""
    scene, style, generator = stretch.scene, stretch.scene.style, stretch.generator
    strip = style.parking > 1.0
    parts: list[Mesh] = []
    if not style.parked or not (strip or scene.park_on_pavement):
        return parts
    middle = stretch.side * (style.edge - 0.5 * max(style.parking, 2.0) + (0.0 if strip else 0.9))
    for slot in np.arange(stretch.start + 3.0, stretch.stop - 2.0, _SLOT):
        if generator.random() < style.parked:
            mesh, colour = library.pick_vehicle("van" if generator.random() < 0.12 else "car", generator)
            turn = (0.0 if generator.random() < 0.8 else np.pi) + stretch.facing
            lateral = middle + generator.normal(0.0, 0.08)
            station = slot + generator.uniform(-0.4, 0.4)
            turn += generator.normal(0.0, 0.02)
            lift = -scene.lift(lateral) - 0.03  # on the carriageway, whatever the height of the pavement
            parts.append(scene.stand(mesh, station, lateral, turn, lift, colour=colour))
    return parts


def _furniture(stretch: Stretch, kind: Furniture) -> list[Mesh]:
    """One piece of furniture, or a row of them."""
    style, generator = stretch.scene.style, stretch.generator
    turn = stretch.facing + generator.normal(0.0, 0.15)
    if kind.facing == "road":
        turn = -stretch.side * np.pi / 2
    elif kind.facing == "any":
        turn = generator.uniform(0.0, 2.0 * np.pi)
    fewest, most = kind.row
    count = int(generator.integers(fewest, most + 1)) if most > fewest else 1
    station, shape = stretch.anywhere(), library.pick(kind.name, generator)
    colour = generator.uniform(0.05, 0.8, 3)
    line = style.edge + (0.5 if style.pavement else 1.5)
    lateral = stretch.side * (line + kind.distance * generator.uniform(0.5, 1.2))
    return [stretch.scene.stand(shape, station + _SPACING * i, lateral, turn, colour=colour) for i in range(count)]


def _pedestrians(stretch: Stretch) -> list[Mesh]:
    """People on the pavement, one in eight on the carriageway."""
    style, generator = stretch.scene.style, stretch.generator
    parts = []
    for _ in range(int(generator.poisson(2.0 * style.people))):
        lateral = stretch.side * (style.edge + generator.uniform(0.4, max(style.pavement, 1.5)))
        if generator.random() < 0.12:
            lateral = stretch.side * generator.uniform(0.6, 1.0) * style.edge
        figure, shirt = library.pick("person", generator), 0.7 * generator.uniform(0.1, 1.0, 3) ** 2
        station, turn = stretch.anywhere(), generator.uniform(0, 6.3)
        parts.append(stretch.scene.stand(figure, station, lateral, turn, colour=shirt))
    return parts


def _cyclist(stretch: Stretch) -> list[Mesh]:
    """Sometimes a cyclist at the edge of the carriageway."""
    style, generator = stretch.scene.style, stretch.generator
    if generator.random() >= 0.4 * style.people:
        return []
    lateral = stretch.side * (style.edge - max(style.parking, 0.6) - 0.3)
    shirt, shape = generator.uniform(0.02, 0.8, 3), library.pick("cyclist", generator)
    return [stretch.scene.stand(shape, stretch.anywhere(), lateral, stretch.facing, colour=shirt)]
