"""One side of the stretch of road that is being populated."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from calibnet.datasets.synthetic.scene import Scene


@dataclass(frozen=True, eq=False)
class Stretch:
    """One side of the road between two stations, while it is populated.

    Attributes:
        scene: the place.
        generator: generator of the chunk, shared by everything that is placed.
        start, stop: stations, metres.
        side: -1 right, 1 left of the centre line.
        near: whether plants are seen from nearby and have all their leaves.
    """

    scene: Scene
    generator: Generator
    start: float
    stop: float
    side: float
    near: bool

    @property
    def facing(self) -> float:
        """Direction of the traffic on this side, radians from the road's direction."""
        return 0.0 if self.side == self.scene.style.side else np.pi

    def anywhere(self) -> float:
        """A random station of the stretch."""
        return self.generator.uniform(self.start, self.stop)
