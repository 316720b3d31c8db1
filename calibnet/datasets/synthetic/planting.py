"""Plants along a road: trees, bushes, thickets, tall grass; and rocks between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibnet.datasets.synthetic import library
from calibnet.datasets.synthetic.mesh import Mesh
from calibnet.datasets.synthetic.stretch import Stretch
from calibnet.datasets.synthetic.style import Style
from calibnet.datasets.synthetic.textures import atlas


@dataclass(frozen=True)
class Belt:
    """A belt along the road over which one kind is scattered, more densely towards the road.

    Attributes:
        kind: name of the prototypes; "tree" for one of the trees of the place.
        count: average number on a side of a chunk.
        inner, outer: distances of its edges from the centre line, metres.
        sizes: smallest and largest factor on the size of the prototype.
        probability: probability that a side of a chunk has the belt.
    """

    kind: str
    count: float
    inner: float
    outer: float
    sizes: tuple[float, float]
    probability: float = 1.0


def plants(stretch: Stretch) -> list[Mesh]:
    """Everything that grows on one side."""
    style = stretch.scene.style
    parts = []
    for belt in _trees_and_bushes(style):
        parts += _scatter(stretch, belt)
    parts += _thicket(stretch)
    for belt in _undergrowth(style):
        parts += _scatter(stretch, belt)
    return parts


def _trees_and_bushes(style: Style) -> list[Belt]:
    """Belts of trees along the road, of trees behind the plots (few in a street, else a wood), and of bushes."""
    verge, street, built = _verge(style), style.kind == "street", style.buildings > 0.4
    row = 0.3 if street else max(style.setback - 1.0, 1.0)
    far = style.front + (18.0 if built else 2.0)
    backyard = Belt("tree", 1.0, style.front + 2.0, style.front + 12.0, (0.8, 1.4), probability=0.3 * style.trees)
    wood = Belt("tree", (0.8 if built else 1.5) * style.trees, far, far + 25.0, (0.9, 1.7))
    bushes = (4.0, 14.0) if style.wild else (1.5, 5.0)
    return [
        Belt("tree", 1.6 * style.trees, verge + 0.8, verge + 0.8 + row, (0.6, 1.2)),
        *([backyard] if street else [wood, wood]),
        Belt("bush", bushes[0] * style.bushes, verge + 1.0, verge + bushes[1], (0.5, 1.4)),
    ]


def _undergrowth(style: Style) -> list[Belt]:
    """Tall grass where the ground is grass, rocks beside a track."""
    verge, wild = _verge(style), style.wild
    tufts = Belt("tuft", (10.0 if wild else 3.0) * style.bushes, verge + 0.3, verge + 9.0, (0.5, 1.6))
    rocks = Belt("rock", 1.0, verge + 0.3, verge + 14.0, (0.5, 1.6))
    grassy = wild or style.verge.texture in atlas().groups["grass"]
    return [*([tufts] if grassy else []), *([rocks] if style.kind == "off-road" else [])]


def _verge(style: Style) -> float:
    """Smallest distance of plants from the centre line, metres; in a street they may stand on the pavement."""
    return style.edge + (0.8 if style.kind == "street" else style.pavement)


def _scatter(stretch: Stretch, belt: Belt) -> list[Mesh]:
    """Place the plants of a belt on one side of a chunk."""
    generator, style = stretch.generator, stretch.scene.style
    if belt.probability < 1.0 and generator.random() >= belt.probability:
        return []
    kind = style.trees_set[int(generator.integers(len(style.trees_set)))] if belt.kind == "tree" else belt.kind
    parts = []
    for _ in range(int(generator.poisson(belt.count))):
        lateral = stretch.side * (belt.inner + (belt.outer - belt.inner) * generator.random() ** 1.5)
        size = generator.uniform(*belt.sizes) * np.array([1.0, 1.0, generator.uniform(0.85, 1.2)])
        station, turn = stretch.anywhere(), generator.uniform(0.0, 2.0 * np.pi)
        parts.append(_grow(stretch, kind, station, lateral, turn, size))
    return parts


def _thicket(stretch: Stretch) -> list[Mesh]:
    """A wall of shrubs along the whole stretch, where there is room for one."""
    generator, style = stretch.generator, stretch.scene.style
    room = style.setback if style.buildings > 0.4 else 12.0
    if room <= 4.0 or generator.random() >= style.thickets:
        return []
    lateral = stretch.side * (max(_verge(style) + 2.0, 6.0) + generator.uniform(0.0, min(room - 2.0, 5.0)))
    parts = []
    for station in (stretch.start + 5.0, stretch.stop - 5.0):
        turn, size = generator.normal(0.0, 0.1), generator.uniform(0.7, 1.2)
        parts.append(_grow(stretch, "thicket", station, lateral, turn, size))
    return parts


def _grow(stretch: Stretch, kind: str, station: float, lateral: float, turn: float, size: float | np.ndarray) -> Mesh:
    """Place one plant, with leaves of about the season's colour."""
    generator = stretch.generator
    colour = stretch.scene.leaf_colour * generator.uniform(0.7, 1.3) * generator.uniform(0.88, 1.12, 3)
    shape = library.pick(kind, generator, stretch.near)
    return stretch.scene.stand(shape, station, lateral, turn, -0.05, size, colour)
