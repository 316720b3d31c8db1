"""Maps over the cells of a cost volume: displacements in flow colours, certainties from dark to bright."""

from __future__ import annotations

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from calibnet.trace import ScaleTrace
from inspector import colors


def flow_image(
    displacement: NDArray[np.floating] | NDArray[np.integer], reach: float, seen: NDArray[np.bool_]
) -> rr.Image:
    """Displacements ``[h, w, 2]`` in flow colours.

    Args:
        displacement: ``(dx, dy)`` in pixels.
        reach: length in pixels that is fully saturated.
        seen: ``[h, w]``, the cells that hold a LiDAR point; the others are painted in `colors.EMPTY`.
    """
    picture = colors.flow_colors(displacement, reach)
    picture[~seen] = colors.EMPTY
    return rr.Image(picture)


def certainty_image(values: NDArray[np.floating], seen: NDArray[np.bool_]) -> rr.Image:
    """Probabilities or confidences ``[h, w]``, 0 dark to 1 bright; cells that are not ``seen`` are empty."""
    picture = colors.certainty_colors(values)
    picture[~seen] = colors.EMPTY
    return rr.Image(picture)


def reach_px(scale: ScaleTrace) -> float:
    """Longest displacement in pixels along one axis that the search window holds."""
    return scale.stride * float(max(scale.volume.shape[0] // 2, scale.volume.shape[1] // 2))
