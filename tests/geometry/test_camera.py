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


@pytest.mark.parametrize("window", [(100, 40, 480, 180), (0, 0, 600, 250), (-20, -30, 700, 300)])
@pytest.mark.parametrize("point", POINTS[:3])
def test_cropped_camera_sees_points_where_the_window_has_them(window, point):
    left, top, width, height = window
    padded = cv2.copyMakeBorder(rendered(point, 3.0), 100, 100, 100, 100, cv2.BORDER_CONSTANT, value=0)
    image = padded[100 + top : 100 + top + height, 100 + left : 100 + left + width]
    cropped = CAMERA.cropped(*window)
    projected = project(point[None], CAMERA_FROM_LIDAR, cropped)
    assert (cropped.width, cropped.height) == image.shape[::-1]
    assert_allclose(projected.pixels[0], centroid(image), atol=0.01)


def test_resizing_in_two_steps_is_resizing_at_once():
    assert_allclose(CAMERA.resized(320, 64).resized(40, 16).matrix, CAMERA.resized(40, 16).matrix, rtol=1e-13)


def test_crop_then_resize_matches_the_picture():
    point = POINTS[2]
    image = cv2.resize(rendered(point)[30:230, 200:600], (100, 50), interpolation=cv2.INTER_AREA)
    camera = CAMERA.cropped(200, 30, 400, 200).resized(100, 50)
    assert_allclose(project(point[None], CAMERA_FROM_LIDAR, camera).pixels[0], centroid(image), atol=0.02)


def test_original_camera_is_left_alone():
    before = CAMERA.matrix.copy()
    CAMERA.resized(10, 10)
    CAMERA.cropped(5, 5, 10, 10)
    assert_allclose(CAMERA.matrix, before, rtol=0)
    assert CAMERA.focal == (350.0, 340.0)
    assert CAMERA.center == (322.3, 118.6)
