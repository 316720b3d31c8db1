"""Named pictures and curves by which any method can show its work."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from calibnet.geometry.types import Floats


@dataclass(frozen=True, eq=False)
class Exhibit:
    """A picture of a method's work on a frame.

    Attributes:
        name: name to show, for instance ``"Masks"``; the same in every frame, and unique within a stage.
        picture: ``[H, W, 3]`` uint8 RGB, or a map ``[H, W]`` float32 with NaN where it has no value.
        limits: values of a map that are drawn darkest and brightest, so that maps can be compared; None for its own.
    """

    name: str
    picture: NDArray[np.uint8] | NDArray[np.float32] = field(repr=False)
    limits: tuple[float, float] | None = None


@dataclass(frozen=True, eq=False)
class Curve:
    """A number over the steps of a search.

    Attributes:
        name: name to show, with the unit, for instance ``"Score of the best so far"``.
        values: ``[N]``, one per step.
    """

    name: str
    values: Floats = field(repr=False)
