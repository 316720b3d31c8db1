"""What a method has to show of its work besides poses: pictures and curves with names, which any method can make."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from calibnet.geometry.types import Floats


@dataclass(frozen=True, eq=False)
class Exhibit:
    """A picture of what a method saw, computed or found in a frame.

    Attributes:
        name: for people, for instance ``"Masks"``; the same in every frame, and different within a stage.
        picture: ``[H, W, 3]`` uint8 RGB, or ``[H, W]`` float32, a map with NaN where there is nothing.
        limits: of a map, the values that are darkest and brightest, so that maps can be compared; None for its own.
    """

    name: str
    picture: NDArray[np.uint8] | NDArray[np.float32] = field(repr=False)
    limits: tuple[float, float] | None = None


@dataclass(frozen=True, eq=False)
class Curve:
    """A number over the steps of a search.

    Attributes:
        name: for people, with its unit, for instance ``"Score of the best so far"``.
        values: ``[N]``, one a step.
    """

    name: str
    values: Floats = field(repr=False)
