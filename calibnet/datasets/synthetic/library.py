"""Prototypes of everything that is placed many times, built once per process and then instanced."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from calibnet.datasets.synthetic import barriers, lorries, street, vegetation, vehicles
from calibnet.datasets.synthetic.mesh import Mesh
from calibnet.datasets.synthetic.textures import Atlas, atlas

Generator = np.random.Generator
_FAR = 0.2
"""Share of the leaves that plants keep where they are seen from afar."""
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


@lru_cache(maxsize=1)
def library() -> dict[str, tuple[tuple[Mesh, Mesh], ...]]:
    """All prototypes by name, each as seen from near and from afar; the same in every process."""
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
