"""The depth of the scan between its points."""

from __future__ import annotations

import numpy as np
import pytest

from calibnet.geometry.types import Floats
from calibnet.motion.surface import NEIGHBOURS, nearest_points, surface

WIDTH = 1000


def rings(depth: object) -> tuple[Floats, Floats]:
    """Points every 2 pixels along rows 5 pixels apart, and their depth by a function of their pixels."""
    u, v = np.meshgrid(np.arange(0, 200, 2.0), np.arange(0, 100, 5.0))
    at = np.stack([u.ravel(), v.ravel()], axis=1)
    assert callable(depth)
    return at, np.asarray(depth(at))


def at_pixels(pixels: Floats, at: Floats, depth: Floats) -> tuple[Floats, np.ndarray]:
    near = nearest_points(pixels, at)
    return surface(pixels, at[near], depth[near], WIDTH)


def test_a_plane_has_its_depth_at_any_pixel() -> None:
    """The inverse depth of a plane is linear over the image."""
    pixels = np.random.default_rng(1).uniform([20, 20], [180, 80], (40, 2))
    inverse, known = at_pixels(pixels, *rings(lambda at: 1 / (0.02 + 0.0004 * at[:, 1] - 0.00005 * at[:, 0])))
    assert known.all()
    assert inverse == pytest.approx(0.02 + 0.0004 * pixels[:, 1] - 0.00005 * pixels[:, 0], rel=1e-4)


def test_there_is_no_surface_at_an_edge_beside_the_scan_or_far_away() -> None:
    at, depth = rings(lambda at: np.where(at[:, 0] < 100, 10.0, 20.0))
    known = at_pixels(np.array([[50.0, 50], [100, 50], [150, 50], [300, 50]]), at, depth)[1]
    assert known.tolist() == [True, False, True, False]
    assert not at_pixels(np.array([[50.0, 50]]), *rings(lambda at: np.full(len(at), 100.0)))[1].any()


def test_too_few_points_are_refused() -> None:
    with pytest.raises(ValueError, match=f"fewer than {NEIGHBOURS}"):
        nearest_points(np.zeros((1, 2)), np.zeros((3, 2)))
