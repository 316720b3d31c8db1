"""Maps of the cells of a cost volume: displacements in flow colours, certainties from dark to bright.

They are translucent over the image, and fully transparent in cells without a LiDAR point.
"""

from __future__ import annotations

import cv2
import numpy as np
import rerun as rr
from numpy.typing import NDArray

from calibnet.trace import ScaleTrace
from inspector import colors

OPACITY = 0.62
"""Opacity of a cell with a point."""
LOGIT_SCALE = 14.0
"""Factor by which the network multiplies matching scores before its softmax, as in `calibnet.network.cost_volume`."""


def flow_image(
    displacement: NDArray[np.floating] | NDArray[np.integer], reach: float, seen: NDArray[np.bool_]
) -> rr.EncodedImage:
    """Displacements ``[h, w, 2]`` in flow colours.

    Args:
        displacement: ``(dx, dy)`` in pixels.
        reach: length in pixels at which colours are fully saturated.
        seen: ``[h, w]``, the cells with a LiDAR point; the others are left out.
    """
    return _image(colors.flow_colors(displacement, reach), seen)


def certainty_image(values: NDArray[np.floating], seen: NDArray[np.bool_]) -> rr.EncodedImage:
    """Probabilities or confidences ``[h, w]``, 0 dark to 1 bright; cells that are not ``seen`` are left out."""
    return _image(colors.certainty_colors(values), seen)


def share_image(values: NDArray[np.floating], seen: NDArray[np.bool_]) -> rr.EncodedImage:
    """Shares ``[h, w]`` of a whole, 0 dark to 1 bright in even steps; cells that are not ``seen`` are left out."""
    return _image(colors.map_colors(values, 0.0, 1.0), seen)


def _image(picture: NDArray[np.uint8], seen: NDArray[np.bool_]) -> rr.EncodedImage:
    """The picture as PNG, a third of the size; the viewer uses alpha only if the image's opacity is below 1."""
    done, encoded = cv2.imencode(".png", np.dstack([picture[..., ::-1], 255 * seen.astype(np.uint8)]))
    assert done, "maps are small"
    return rr.EncodedImage(contents=encoded.tobytes(), media_type="image/png", opacity=OPACITY)


def decidedness(probability: NDArray[np.floating]) -> NDArray[np.float32]:
    """``[h, w]`` float32, how far ``[Dy, Dx, h, w]`` probabilities have decided: 0 all alike, 1 a single displacement.

    It is one minus the entropy relative to the largest entropy.
    """
    p = np.clip(probability.astype(np.float32), 1e-12, 1.0).reshape(-1, *probability.shape[2:])
    entropy = -(p * np.log(p)).sum(axis=0)
    decided: NDArray[np.float32] = np.clip(1.0 - entropy / np.log(len(p)), 0.0, 1.0).astype(np.float32)
    return decided


def mass_on_truth(probability: NDArray[np.floating], true: NDArray[np.floating]) -> NDArray[np.float32]:
    """``[h, w]`` float32: the share of each window's probability that lies within a cell of the true displacement.

    Args:
        probability: ``[Dy, Dx, h, w]``.
        true: ``[h, w, 2]`` displacement ``(dx, dy)`` in cells; where it lies beyond the window the share is 0.
    """
    down, across = probability.shape[:2]
    dy, dx = np.mgrid[:down, :across].astype(np.float32) - np.array([down // 2, across // 2], np.float32)[:, None, None]
    near = np.maximum(abs(dx[..., None, None] - true[..., 0]), abs(dy[..., None, None] - true[..., 1])) <= 1.0
    mass: NDArray[np.float32] = np.where(near, probability.astype(np.float32), np.float32(0)).sum(axis=(0, 1))
    return np.clip(mass, 0.0, 1.0)


def within_window(scale: ScaleTrace, true: NDArray[np.floating]) -> NDArray[np.bool_]:
    """``[h, w]``: where the true displacement ``[h, w, 2]`` in cells is one of those that the window searches."""
    down, across = scale.probability.shape[:2]
    reach = np.array([across // 2 + 1, down // 2 + 1])
    return np.asarray((abs(true) <= reach).all(axis=-1))


def matching_probability(scale: ScaleTrace) -> NDArray[np.float32]:
    """``[Dy, Dx, h, w]``: the probability of every displacement by the matching scores alone, before aggregation."""
    scores = LOGIT_SCALE * scale.volume.astype(np.float32)
    weights = np.exp(scores - scores.max(axis=(0, 1)))
    probability: NDArray[np.float32] = weights / weights.sum(axis=(0, 1))
    return probability


def subcell_match(scale: ScaleTrace) -> NDArray[np.float32]:
    """``[h, w, 2]`` float32 displacement ``(dx, dy)`` in cells: the mean of the most probable one and its neighbours.

    The last stages move points by less than a cell, which the most probable displacement alone would not show.
    """
    down, across = scale.probability.shape[:2]
    padded = np.pad(scale.probability.astype(np.float32), ((1, 1), (1, 1), (0, 0), (0, 0)))
    rows, columns = np.indices(scale.occupied.shape)
    dx, dy = scale.best[..., 0], scale.best[..., 1]
    total, moment = np.zeros(scale.occupied.shape, np.float32), np.zeros((*scale.occupied.shape, 2), np.float32)
    for step_y in (-1, 0, 1):
        for step_x in (-1, 0, 1):
            share = padded[dy + down // 2 + 1 + step_y, dx + across // 2 + 1 + step_x, rows, columns]
            total += share
            moment += share[..., None] * np.array([step_x, step_y], np.float32)
    return (scale.best + moment / np.maximum(total, 1e-6)[..., None]).astype(np.float32)


def reach_px(scale: ScaleTrace) -> float:
    """Largest displacement of the search window along an axis, in pixels."""
    return scale.stride * float(max(scale.volume.shape[0] // 2, scale.volume.shape[1] // 2))
