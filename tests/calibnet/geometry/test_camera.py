"""Resizing and cropping against OpenCV's own pixels: a dot drawn in the large image stays where K says."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose

from calibnet.geometry import PinholeCamera, project, transform

CAMERA = PinholeCamera(640, 256, np.array([[350.0, 0.0, 322.3], [0.0, 340.0, 118.6], [0.0, 0.0, 1.0]]))
CAMERA_FROM_LIDAR = transform([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]], [0.1, -0.2, 0.3])
POINTS = np.array([[10.0, 3.0, 1.0], [14.0, -6.5, -1.5], [8.0, 0.4, -0.6], [20.0, 11.0, 3.0]], np.float32)


def rendered(point: np.ndarray, sigma: float = 9.0) -> np.ndarray:
    """An image of ``CAMERA`` with one soft dot where the point is projected, by plain arithmetic."""
    x, y, z = -point[1] + 0.1, -point[2] - 0.2, point[0] + 0.3
    v, u = np.mgrid[0:256, 0:640]
    return np.exp(-((u - 350 * x / z - 322.3) ** 2 + (v - 340 * y / z - 118.6) ** 2) / (2 * sigma**2))


def centroid(image: np.ndarray) -> np.ndarray:
    v, u = np.mgrid[0 : image.shape[0], 0 : image.shape[1]]
    return np.array([(u * image).sum(), (v * image).sum()]) / image.sum()


@pytest.mark.parametrize("size", [(320, 128), (80, 32), (512, 160), (1280, 512), (213, 64)])
@pytest.mark.parametrize("point", POINTS)
def test_resized_camera_sees_points_where_the_resized_image_has_them(size, point):
    resized = CAMERA.resized(*size)
    interpolation = cv2.INTER_AREA if size[0] < 640 else cv2.INTER_LINEAR
    image = cv2.resize(rendered(point), size, interpolation=interpolation)
    projected = project(point[None], CAMERA_FROM_LIDAR, resized)
    assert (resized.width, resized.height) == size
    assert_allclose(projected.pixels[0], centroid(image), atol=0.02)


def test_resizing_in_two_steps_is_resizing_at_once():
    assert_allclose(CAMERA.resized(320, 64).resized(40, 16).matrix, CAMERA.resized(40, 16).matrix, rtol=1e-13)


def test_original_camera_is_left_alone():
    before = CAMERA.matrix.copy()
    CAMERA.resized(10, 10)
    CAMERA.fitted(10, 10, 1)
    assert_allclose(CAMERA.matrix, before, rtol=0)
    assert CAMERA.focal == (350.0, 340.0)
    assert CAMERA.center == (322.3, 118.6)
