"""Tracks pixels from one image to the next by Lucas-Kanade, starting from where they are expected."""

from __future__ import annotations

import itertools

import cv2
import numpy as np
from numpy.typing import NDArray

from calibnet.geometry.types import Floats

ROWS, COLUMNS, CORNERS = 4, 8, 24
"""The image is divided into this many rows and columns, and has at most this many corners in each part."""
QUALITY, APART_PX = 0.02, 5
"""Smallest strength of a corner relative to the strongest of its part, and smallest distance between corners."""
WINDOW, LEVELS = 1 / 80, 2
"""Side of the tracked window in widths of the image, and levels of the pyramid beyond the image itself."""
RETURN_PX = 0.5
"""Largest distance from its start at which a pixel may arrive when it is tracked back."""


def corners(image: NDArray[np.uint8]) -> Floats:
    """Corners ``[N, 2]`` spread over a grey image ``[H, W]``, in pixels."""
    height, width = image.shape
    found: list[Floats] = [np.empty((0, 2))]
    for top, bottom in _parts(height, ROWS):
        for left, right in _parts(width, COLUMNS):
            part = image[top:bottom, left:right]
            inside = cv2.goodFeaturesToTrack(part, CORNERS, QUALITY, APART_PX) if part.size else None
            if inside is not None:
                found.append(np.asarray(inside, np.float64).reshape(-1, 2) + np.array([left, top]))
    return np.concatenate(found)


def tracked(
    image: NDArray[np.uint8], following: NDArray[np.uint8], pixels: Floats, expected: Floats
) -> tuple[Floats, NDArray[np.bool_]]:
    """Track pixels ``[N, 2]`` of a grey image to the following one.

    Args:
        image: ``[H, W]``.
        following: ``[H, W]``.
        pixels: of ``image``.
        expected: ``[N, 2]``, where to begin the search in ``following``.

    Returns:
        Pixels ``[N, 2]`` of ``following``, and whether each was found: it is inside the image, and tracking it back
        arrives where it began.
    """
    if not len(pixels):
        return pixels, np.zeros(0, bool)
    there, found = _search(image, following, pixels, expected)
    back, found_back = _search(following, image, there, pixels)
    height, width = image.shape
    inside = ((there >= 0) & (there <= [width - 1, height - 1])).all(axis=1)
    return there, found & found_back & inside & (np.linalg.norm(back - pixels, axis=1) < RETURN_PX)


def _search(
    image: NDArray[np.uint8], following: NDArray[np.uint8], pixels: Floats, expected: Floats
) -> tuple[Floats, NDArray[np.bool_]]:
    side = 2 * round(image.shape[1] * WINDOW / 2) + 1
    there, found, _ = cv2.calcOpticalFlowPyrLK(
        image,
        following,
        pixels.astype(np.float32),
        expected.astype(np.float32),
        winSize=(side, side),
        maxLevel=LEVELS,
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
    )
    return np.asarray(there, np.float64).reshape(-1, 2), np.asarray(found).ravel() == 1


def _parts(length: int, count: int) -> list[tuple[int, int]]:
    return list(itertools.pairwise(np.linspace(0, length, count + 1).astype(int).tolist()))
