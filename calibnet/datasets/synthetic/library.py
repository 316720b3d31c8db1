"""Prototypes of everything that is placed many times, built once per process and then instanced."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from calibnet.datasets.synthetic import street, vegetation, vehicles
from calibnet.datasets.synthetic.mesh import Mesh
from calibnet.datasets.synthetic.textures import Atlas, atlas

_PLAN: dict[str, tuple[int, Callable[[Atlas, np.random.Generator], Mesh]]] = {
    "car": (28, vehicles.car),
    "van": (8, vehicles.van),
    "lorry": (8, vehicles.lorry),
    "bicycle": (3, vehicles.bicycle),
    "broadleaf": (14, vegetation.broadleaf),
    "conifer": (6, vegetation.conifer),
    "bare_tree": (4, vegetation.bare_tree),
    "bush": (8, vegetation.bush),
    "tuft": (6, vegetation.grass_tuft),
    "hedge": (6, vegetation.hedge),
    "lamp_post": (8, street.lamp_post),
    "pole": (8, street.pole),
    "bollard": (6, street.bollard),
    "sign": (20, street.sign),
    "traffic_light": (6, street.traffic_light),
    "bin": (10, street.bin_or_box),
    "bench": (3, street.bench),
    "person": (20, street.person),
    "fence": (14, street.fence),
    "guard_rail": (5, street.guard_rail),
    "gantry": (4, street.gantry),
    "billboard": (10, street.billboard),
    "rock": (6, street.rock),
}


@lru_cache(maxsize=1)
def library() -> dict[str, tuple[Mesh, ...]]:
    """All prototypes by name; the same in every process."""
    generator = np.random.default_rng(7_101)
    tiles = atlas()
    return {name: tuple(build(tiles, generator) for _ in range(count)) for name, (count, build) in _PLAN.items()}


def pick(name: str, generator: np.random.Generator) -> Mesh:
    """A random prototype of a kind."""
    variants = library()[name]
    return variants[int(generator.integers(len(variants)))]
