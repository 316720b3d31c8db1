"""Colours that mean the same in every view: depth, displacement direction, score and stage."""

from __future__ import annotations

from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

Rgb = tuple[int, int, int]

NEAR_M: Final = 3.0
FAR_M: Final = 80.0
LABELLED_DEPTHS_M: Final = (3, 5, 10, 20, 40, 80)
"""Depths in metres that are labelled on the scale of their colours."""
EMPTY: Final[Rgb] = (62, 63, 72)
"""Cells that hold no LiDAR point."""
EDGE: Final[Rgb] = (255, 60, 220)
"""Points at depth discontinuities, in a colour that streets and cars do not have."""
REST: Final[Rgb] = (120, 170, 190)
"""Points that are not at depth discontinuities, beside `EDGE`."""
WORST_PX: Final = 20.0
"""Displacement from the reference at which points are fully red."""
INITIAL: Final[Rgb] = (255, 75, 75)
REFERENCE: Final[Rgb] = (255, 255, 255)
LIMIT: Final[Rgb] = (150, 150, 150)
GROUND: Final[Rgb] = (24, 26, 30)
"""Background of images and text, also in the light theme, where dimmed images would wash out on white."""
LETTERS: Final[Rgb] = (235, 236, 240)
VERDICTS: Final[dict[str, Rgb]] = {
    "accepted": (110, 240, 140),
    "rejected": (255, 110, 100),
    "cannot tell": (255, 205, 80),
}
"""Colours of the words of `calibnet.verdict`."""
FOUND: Final[Rgb] = (90, 255, 120)
STAGES: Final[dict[int, Rgb]] = {
    1: (255, 140, 40),
    2: (255, 205, 60),
    3: (190, 130, 255),
    4: (80, 170, 255),
    5: (80, 220, 110),
}

_RAMP = np.arange(256, dtype=np.uint8)[None]
TURBO: Final[NDArray[np.uint8]] = cv2.applyColorMap(_RAMP, cv2.COLORMAP_TURBO)[0, :, ::-1].astype(np.uint8)
VIRIDIS: Final[NDArray[np.uint8]] = cv2.applyColorMap(_RAMP, cv2.COLORMAP_VIRIDIS)[0, :, ::-1].astype(np.uint8)


def depth_colors(depth: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Turbo on the logarithm of depth: red at `NEAR_M` and nearer, blue at `FAR_M` and farther.

    Args:
        depth: ``[...]`` metres, positive.

    Returns:
        ``[..., 3]`` uint8 RGB.
    """
    log_depth = np.log(np.maximum(depth, 1e-3) / NEAR_M) / np.log(FAR_M / NEAR_M)
    colors: NDArray[np.uint8] = TURBO[(245 - 235 * np.clip(log_depth, 0.0, 1.0)).astype(np.intp)]
    return colors


def error_colors(displacement: NDArray[np.floating]) -> NDArray[np.uint8]:
    """Turbo from blue (no error) to red (`WORST_PX` pixels or more); ``[...]`` to ``[..., 3]`` uint8 RGB."""
    level = np.clip(displacement / WORST_PX, 0.0, 1.0)
    colors: NDArray[np.uint8] = TURBO[(25 + 215 * level).astype(np.intp)]
    return colors


def flow_colors(displacement: NDArray[np.floating] | NDArray[np.integer], reach: float) -> NDArray[np.uint8]:
    """Hue by direction, saturation by the square root of length; white = none.

    Args:
        displacement: ``[..., 2]`` as ``(dx, dy)``.
        reach: length, in the same unit, at which colours are fully saturated.

    Returns:
        ``[..., 3]`` uint8 RGB; red right, green down, cyan left, violet up.
    """
    shape = displacement.shape[:-1]
    dx, dy = np.asarray(displacement, dtype=np.float32).reshape(-1, 2).T
    hue = np.degrees(np.arctan2(dy, dx)) % 360.0
    saturation = np.sqrt(np.clip(np.hypot(dx, dy) / reach, 0.0, 1.0))
    hsv = np.stack([hue, saturation, np.ones_like(hue)], axis=-1).astype(np.float32)
    rgb = cv2.cvtColor(hsv[None], cv2.COLOR_HSV2RGB)[0]
    colors: NDArray[np.uint8] = (255.0 * rgb).round().astype(np.uint8).reshape(*shape, 3)
    return colors


def certainty_colors(values: NDArray[np.floating]) -> NDArray[np.uint8]:
    """Viridis on the square root of a probability or confidence, 0 dark to 1 bright, so that small ones differ."""
    return map_colors(np.sqrt(np.clip(values.astype(np.float32), 0.0, 1.0)), 0.0, 1.0)


def map_colors(values: NDArray[np.floating], low: float, high: float) -> NDArray[np.uint8]:
    """Viridis from ``low`` (dark) to ``high`` (bright); ``[...]`` to ``[..., 3]`` uint8 RGB."""
    span = max(high - low, 1e-6)
    level = np.clip((np.nan_to_num(values.astype(np.float32)) - low) / span, 0.0, 1.0)
    colors: NDArray[np.uint8] = VIRIDIS[(255.0 * level).astype(np.intp)]
    return colors


def robust_limits(values: NDArray[np.floating]) -> tuple[float, float]:
    """Second and 98th percentile, as contrast limits of a map that outliers do not affect."""
    if values.size == 0:
        return 0.0, 1.0
    low, high = np.percentile(values.astype(np.float32), [2.0, 98.0])
    return float(low), float(high)
