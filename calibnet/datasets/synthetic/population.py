"""Fills a chunk of road with ground, buildings, parked cars, furniture, plants and people."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from calibnet.datasets.synthetic import library
from calibnet.datasets.synthetic.ground import cross_section, markings
from calibnet.datasets.synthetic.mesh import Mesh, concatenate
from calibnet.datasets.synthetic.planting import plants
from calibnet.datasets.synthetic.plots import plots
from calibnet.datasets.synthetic.roadside import roadside
from calibnet.datasets.synthetic.scene import Scene
from calibnet.datasets.synthetic.stretch import Stretch

CHUNK = 20.0
"""Length of a chunk, metres."""


def populate(scene: Scene, index: int, near: bool) -> Mesh:
    """All static objects of a chunk; they depend only on the scene and the index.

    Args:
        scene: the place.
        index: number of the chunk, counted from station 0.
        near: whether plants have all their leaves; their places do not depend on it.
    """
    generator = np.random.default_rng([scene.seed, index + 10_000])
    start, stop = index * CHUNK, (index + 1) * CHUNK
    parts = [*cross_section(scene, start, stop), *markings(scene, generator, start, stop)]
    for side in (-1.0, 1.0):
        stretch = Stretch(scene, generator, start, stop, side, near)
        parts += [*plots(stretch), *roadside(stretch), *plants(stretch)]
    if scene.style.kind == "highway":
        parts += _motorway(scene, generator, start, stop)
    return concatenate(parts)


def _motorway(scene: Scene, generator: Generator, start: float, stop: float) -> list[Mesh]:
    """Crash barriers and sometimes a sign gantry or a bridge."""
    edge = scene.style.edge + 1.0
    rails = (0.0, -edge, edge) if scene.outer_rails else (0.0,)
    parts = [scene.stand(scene.rail, s, lateral) for s in np.arange(start + 2.0, stop, 4.0) for lateral in rails]
    if generator.random() < 0.12:
        name = "gantry" if generator.random() < 0.6 else "bridge"
        parts.append(scene.stand(library.pick(name, generator), 0.5 * (start + stop), 0.0))
    return parts
