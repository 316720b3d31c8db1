"""Corners, and where they are in the next image."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from calibnet.motion.tracks import COLUMNS, CORNERS, ROWS, corners, tracked

BY = np.array([13.4, -5.7])


def textured(seed: int = 0) -> NDArray[np.uint8]:
    noise = np.random.default_rng(seed).uniform(0, 255, (100, 200)).astype(np.float32)
    return cv2.resize(noise, (800, 400), interpolation=cv2.INTER_CUBIC).clip(0, 255).astype(np.uint8)


def shifted(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    matrix = np.array([[1.0, 0, BY[0]], [0, 1, BY[1]]])
    return np.asarray(cv2.warpAffine(image, matrix, (800, 400), flags=cv2.INTER_CUBIC), np.uint8)


def test_corners_are_spread_over_the_image() -> None:
    found = corners(textured())
    assert len(found) == ROWS * COLUMNS * CORNERS
    parts = np.floor(found / [800 / COLUMNS, 400 / ROWS]).astype(int)
    assert len(np.unique(parts, axis=0)) == ROWS * COLUMNS
    assert not len(corners(np.zeros((400, 800), np.uint8)))


def test_pixels_are_found_again_to_a_twentieth() -> None:
    image = textured()
    pixels = corners(image)
    there, found = tracked(image, shifted(image), pixels, pixels + BY + 4)
    inside = ((pixels + BY > 15) & (pixels + BY < [785, 385])).all(axis=1)
    assert found[inside].mean() > 0.95
    assert np.median(np.linalg.norm(there - pixels - BY, axis=1)[found]) < 0.05


def test_what_is_not_there_is_not_found() -> None:
    image = textured()
    pixels = corners(image)
    there, found = tracked(image, textured(1), pixels, pixels)
    assert found.mean() < 0.2
    there, found = tracked(image, shifted(image), np.array([[795.0, 200]]), np.array([[795.0, 200]]) + BY)
    assert there.shape == (1, 2) and not found.any()
    assert not len(tracked(image, image, np.empty((0, 2)), np.empty((0, 2)))[1])
