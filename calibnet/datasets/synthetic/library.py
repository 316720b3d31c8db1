"""Prototypes of objects that are placed many times, built once per process and then instanced."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.random import Generator

from calibnet.datasets.synthetic import barriers, lorries, street, vegetation, vehicles
from calibnet.datasets.synthetic.mesh import Mesh
from calibnet.datasets.synthetic.textures import Atlas, atlas
from calibnet.geometry.types import Floats

_FAR = 0.2
"""Share of their leaves that distant plants keep."""
_PLANTS: dict[str, tuple[int, Callable[[Atlas, Generator, float], Mesh]]] = {
    "broadleaf": (14, vegetation.broadleaf),
    "conifer": (6, vegetation.conifer),
    "bare_tree": (5, vegetation.bare_tree),
    "bush": (8, vegetation.bush),
    "tuft": (6, vegetation.grass_tuft),
    "hedge": (6, vegetation.hedge),
    "thicket": (8, vegetation.thicket),
}
_THINGS: dict[str, tuple[int, Callable[[Atlas, Generator], Mesh]]] = {
    "car": (28, vehicles.car),
    "van": (8, vehicles.van),
    "lorry": (10, lorries.lorry),
    "bicycle": (3, vehicles.bicycle),
    "cyclist": (4, street.cyclist),
    "lamp_post": (8, street.lamp_post),
    "pole": (8, street.pole),
    "bollard": (6, street.bollard),
    "sign": (20, street.sign),
    "traffic_light": (6, street.traffic_light),
    "bin": (10, street.bin_or_box),
    "bench": (3, street.bench),
    "person": (20, street.person),
    "fence": (14, barriers.fence),
    "guard_rail": (5, barriers.guard_rail),
    "gantry": (4, barriers.gantry),
    "bridge": (4, barriers.bridge),
    "billboard": (10, barriers.billboard),
    "rock": (6, street.rock),
}

_CAR_COLOURS = (
    (0.75, 0.75, 0.76),
    (0.62, 0.62, 0.62),
    (0.38, 0.40, 0.42),
    (0.20, 0.21, 0.23),
    (0.10, 0.105, 0.11),
    (0.02, 0.02, 0.025),
    (0.02, 0.02, 0.022),
    (0.90, 0.90, 0.90),
    (0.02, 0.04, 0.14),
    (0.06, 0.14, 0.35),
    (0.35, 0.02, 0.02),
    (0.14, 0.01, 0.02),
    (0.04, 0.10, 0.06),
    (0.30, 0.25, 0.18),
    (0.65, 0.48, 0.03),
)
"""Linear RGB of car paints; greys, black and white are as frequent as on the road."""


@lru_cache(maxsize=1)
def library() -> dict[str, tuple[tuple[Mesh, Mesh], ...]]:
    """All prototypes by name, each in a near and a distant version; the same in every process."""
    tiles = atlas()
    shelves: dict[str, tuple[tuple[Mesh, Mesh], ...]] = {}
    for name, (count, grow) in _PLANTS.items():
        seeds = [[7_101, len(shelves), number] for number in range(count)]
        shelves[name] = tuple(
            (grow(tiles, np.random.default_rng(seed), 1.0), grow(tiles, np.random.default_rng(seed), _FAR))
            for seed in seeds
        )
    generator = np.random.default_rng(7_102)
    for name, (count, build) in _THINGS.items():
        meshes = [build(tiles, generator) for _ in range(count)]
        shelves[name] = tuple((mesh, mesh) for mesh in meshes)
    return shelves


def pick(name: str, generator: Generator, near: bool = True) -> Mesh:
    """A random prototype of a kind."""
    variants = library()[name]
    return variants[int(generator.integers(len(variants)))][0 if near else 1]


def pick_vehicle(kind: str, generator: Generator) -> tuple[Mesh, Floats]:
    """A random prototype of a kind of vehicle, and the linear RGB ``[3]`` of its paint."""
    mesh = pick(kind, generator)
    colour = np.array(_CAR_COLOURS[int(generator.integers(len(_CAR_COLOURS)))])
    return mesh, colour * generator.uniform(0.7, 1.2)
