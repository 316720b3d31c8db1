"""Whether a scan can be what it is taken to be; see `calibnet.datasets.plausibility`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from calibnet.datasets.plausibility import Implausible
from calibnet.geometry.visibility import is_accumulated

NEAREST_M, FARTHEST_M = 0.5, 250.0
"""Range of the median distance of a scan's points, in metres."""
FLAT = 0.4
"""Largest ratio of a scene's height to its width if z is up."""
ENOUGH_POINTS = 10_000
"""Points of a scan that are looked at."""


def of_scan(points: NDArray[np.float32]) -> list[Implausible | None]:
    """All checks of a scan ``[N, 4]``."""
    return [ranges(points), up(points), several(points)]


def ranges(points: NDArray[np.float32]) -> Implausible | None:
    """Check the distances of the points, which should be in metres."""
    middle = float(np.median(np.linalg.norm(sample(points).astype(np.float64), axis=1)))
    if NEAREST_M <= middle <= FARTHEST_M:
        return None
    seen = f"half of its points are more than {middle:.3g} m away" if middle > FARTHEST_M else (
        f"half of its points are within {100 * middle:.3g} cm"
    )  # fmt: skip
    guess = "they seem to be in kilometres or scaled, so give metres"
    if middle > FARTHEST_M:
        guess = "they seem to be in millimetres or centimetres, or of a map, so give metres from the LiDAR"
    return Implausible("units", f"{seen}; {guess}", certain=True)


def up(points: NDArray[np.float32]) -> Implausible | None:
    """Check that z is the vertical axis, since the world is wider than high."""
    low, high = np.percentile(sample(points), (10, 90), axis=0)
    spread = np.maximum(high - low, 1e-6)
    flattest = int(spread.argmin())
    if flattest == 2 or spread[flattest] > FLAT * spread[2]:
        return None
    text = (
        f"the scan is flattest along its {'xy'[flattest]} axis ({spread[flattest]:.1f} m; {spread[2]:.1f} m along z); "
        "give points with x forward, y left and z up"
    )
    return Implausible("axes", text)


def several(points: NDArray[np.float32]) -> Implausible | None:
    """Check that the cloud is a scan rather than several."""
    if not is_accumulated(points):
        return None
    text = (
        "the cloud seems to be several scans put together, of which only what one scan would see is used; "
        "give the one scan that was taken with the image"
    )
    return Implausible("accumulated", text)


def sample(points: NDArray[np.float32]) -> NDArray[np.float32]:
    """A sample of the positions ``[N, 3]``, enough for a median."""
    return points[:: max(1, len(points) // ENOUGH_POINTS), :3]
