"""The plots along a road: buildings and fences."""

from __future__ import annotations

import numpy as np

from calibnet.datasets.synthetic import buildings, library
from calibnet.datasets.synthetic.mesh import Mesh
from calibnet.datasets.synthetic.stretch import Stretch
from calibnet.datasets.synthetic.textures import atlas

_BUILDERS = {
    "town_house": buildings.town_house,
    "detached_house": buildings.detached_house,
    "block": buildings.block,
}


def plots(stretch: Stretch) -> list[Mesh]:
    """Fences and buildings of one or two plots, or nothing where a side street joins."""
    style, generator = stretch.scene.style, stretch.generator
    parts: list[Mesh] = []
    if generator.random() < 0.06 and style.kind in ("street", "suburb", "industrial"):
        return parts  # a side street
    pieces = 1 if style.building == "block" or generator.random() < 0.45 else 2
    width = (stretch.stop - stretch.start) / pieces
    for piece in range(pieces):
        station = stretch.start + (piece + 0.5) * width
        if generator.random() < style.fences and style.setback > 2.0:
            parts += _fence(stretch, station, width)
        if generator.random() < style.buildings:
            parts.append(_building(stretch, station, width))
    return parts


def _fence(stretch: Stretch, station: float, width: float) -> list[Mesh]:
    """A fence or hedge along the street side of a plot, in pieces of 4 m."""
    scene, style = stretch.scene, stretch.scene.style
    hedge = scene.fence_kind == "hedge"
    shape = library.pick("hedge", stretch.generator, stretch.near) if hedge else scene.fence(stretch.side)
    lateral = stretch.side * max(style.edge + style.pavement + 0.4, 5.0)
    middles = np.arange(station - 0.5 * width + 2.0, station + 0.5 * width, 4.0)
    return [scene.stand(shape, middle, lateral, colour=scene.leaf_colour) for middle in middles]


def _building(stretch: Stretch, station: float, width: float) -> Mesh:
    """A building with its front towards the road and a gap to its neighbours."""
    style, generator = stretch.scene.style, stretch.generator
    gap = 0.0 if style.building == "town_house" and generator.random() < 0.8 else generator.uniform(1.0, 5.0)
    if style.building == "detached_house":
        gap = generator.uniform(0.15, 0.4) * width
    builder = _BUILDERS[style.building]
    house = builder(atlas(), generator, max(width - gap, 5.0), int(generator.integers(*style.storeys)))
    closed_front = style.kind == "street"
    lateral = stretch.side * (style.front + generator.uniform(0.0, 0.6 if closed_front else 4.0))
    turn = 0.0 if stretch.side > 0 else np.pi
    turn += generator.normal(0.0, 0.0 if closed_front else 0.05)
    return stretch.scene.stand(house, station, lateral, turn, -0.3)
