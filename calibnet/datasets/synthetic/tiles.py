"""The plan of the atlas: its tiles, their numbers and their sizes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from calibnet.datasets.synthetic import facade_tiles, surface_tiles
from calibnet.datasets.synthetic.drawing import Image, colour, speckled


@dataclass(frozen=True, eq=False)
class Tile:
    """One tile: its group, the metres it covers, and ``[256, 256, 4]`` uint8 colour + reflectance."""

    group: str
    metres: float
    image: NDArray[np.uint8]


_PLAN: tuple[tuple[str, float, int, Callable[[Generator], Image]], ...] = (
    ("plain", 2.0, 1, lambda g: speckled(g, (0.92, 0.92, 0.92), 0.45, 0.02)),
    ("concrete", 3.0, 4, lambda g: speckled(g, colour(g, 0.5, 0.75, 0.05), 0.4, 0.07)),
    ("plaster", 4.0, 6, lambda g: speckled(g, colour(g, 0.5, 0.95, 0.15), 0.45, 0.05)),
    ("paint", 1.0, 3, lambda g: speckled(g, (0.9, 0.9, 0.88), 0.9, 0.10, 8)),
    ("black", 1.0, 1, lambda g: speckled(g, (0.12, 0.12, 0.12), 0.08, 0.1)),
    ("glass", 2.0, 3, lambda g: speckled(g, (0.2, 0.22, 0.24), 0.04, 0.15, 2)),
    ("lamp", 0.3, 2, lambda g: speckled(g, (0.9, 0.9, 0.9), 1.0, 0.1, 8)),
    ("asphalt", 4.0, 8, surface_tiles.asphalt),
    ("paving", 2.0, 6, surface_tiles.paving),
    ("brick", 1.5, 6, surface_tiles.bricks),
    ("kerb", 2.0, 6, surface_tiles.kerb),
    ("grass", 3.0, 6, surface_tiles.grass),
    ("soil", 4.0, 6, surface_tiles.soil),
    ("leaves", 1.4, 8, surface_tiles.leaves),
    ("bark", 1.0, 3, surface_tiles.bark),
    ("facade", 6.0, 36, facade_tiles.facade),
    ("ground_floor", 4.0, 14, facade_tiles.ground_floor),
    ("roof", 4.0, 6, surface_tiles.roof_tiles),
    ("planks", 1.6, 5, surface_tiles.planks),
    ("metal", 2.0, 2, surface_tiles.metal),
    ("art", 1.0, 14, surface_tiles.panel_art),
    ("sign", 1.0, 14, surface_tiles.sign_face),
    ("wheel", 1.0, 3, surface_tiles.wheel),
    ("cloth", 0.8, 6, surface_tiles.cloth),
    ("fence", 1.0, 4, surface_tiles.mesh_fence),
)


def draw_all(generator: Generator) -> list[Tile]:
    """Draw every tile of the plan."""
    drawn = []
    for group, metres, count, draw in _PLAN:
        for _ in range(count):
            image = np.clip(255.0 * draw(generator), 0.0, 255.0).astype(np.uint8)
            drawn.append(Tile(group, metres, image))
    return drawn
