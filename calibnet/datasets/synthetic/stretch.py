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
        generator: of the chunk; whatever is placed draws from it in turn.
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
        """Direction in which this side's traffic drives, radians from the road's."""
        return 0.0 if self.side == self.scene.style.side else np.pi

    def anywhere(self) -> float:
        """A random station of the stretch."""
        return self.generator.uniform(self.start, self.stop)
