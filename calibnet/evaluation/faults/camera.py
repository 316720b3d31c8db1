"""Faults of the camera's intrinsics."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from calibnet.datasets.frame import Frame
from calibnet.evaluation.faults.alteration import NATIVE_WIDTH, Alteration
from calibnet.geometry import PinholeCamera


def with_matrix(frame: Frame, change: NDArray[np.float64]) -> Frame:
    """The frame with the camera matrix ``change @ matrix``."""
    camera = frame.camera
    return replace(frame, camera=PinholeCamera(camera.width, camera.height, change @ camera.matrix))


def focal(factor: float) -> Alteration:
    """Multiply the focal length by ``factor``; the image stays."""

    def alter(frame: Frame) -> Frame:
        matrix = frame.camera.matrix.copy()
        matrix[:2, :2] *= factor
        return replace(frame, camera=PinholeCamera(frame.camera.width, frame.camera.height, matrix))

    return alter


def principal(right: float, down: float) -> Alteration:
    """Move the principal point by this many native pixels; the image stays."""

    def alter(frame: Frame) -> Frame:
        scale = frame.camera.width / NATIVE_WIDTH
        return with_matrix(frame, np.array([[1.0, 0.0, right * scale], [0.0, 1.0, down * scale], [0.0, 0.0, 1.0]]))

    return alter


def matrix_of_size(factor: float) -> Alteration:
    """Give the camera matrix of the image resized by a factor."""

    def alter(frame: Frame) -> Frame:
        width, height = round(factor * frame.camera.width), round(factor * frame.camera.height)
        matrix = frame.camera.resized(width, height).matrix
        return replace(frame, camera=PinholeCamera(frame.camera.width, frame.camera.height, matrix))

    return alter


def distorted(k1: float) -> Alteration:
    """The image of a lens with this radial distortion, not rectified."""

    def alter(frame: Frame) -> Frame:
        return relensed(frame, lambda radius: radius * (1 + k1 * radius**2))

    return alter


def equidistant(frame: Frame) -> Frame:
    """The image of a fisheye lens (equidistant projection), treated as that of a pinhole."""
    return relensed(frame, np.arctan)


def relensed(frame: Frame, bend: Callable[[NDArray[np.float64]], NDArray[np.float64]]) -> Frame:
    """The image of a lens that shows at ``bend(r)`` what a pinhole shows at ``r`` (tangents of angles, ``[N]``).

    It is cropped to the largest rectangle without black borders, and the camera matrix accordingly.
    """
    camera = frame.camera
    (fx, fy), (cx, cy) = camera.focal, camera.center
    # a table of the inverse, as far as the lens is invertible
    pinhole = np.linspace(0.0, 3.0, 3001)
    seen = bend(pinhole)
    rising = int(np.argmax(np.diff(seen) <= 0)) or len(seen)
    pinhole, seen = pinhole[:rising], seen[:rising]
    edges = np.array([-cx, camera.width - 1 - cx]) / fx, np.array([-cy, camera.height - 1 - cy]) / fy
    corner_x, corner_y = (grid.ravel() for grid in np.meshgrid(*edges))
    corners = np.hypot(corner_x, corner_y)
    share = min(1.0, float((np.interp(corners, pinhole, seen) / corners).min()))
    left, top = (int(np.ceil(centre - share * centre)) for centre in (cx, cy))
    width, height = int(share * (camera.width - 1)), int(share * (camera.height - 1))
    v, u = np.mgrid[top : top + height, left : left + width].astype(np.float64)
    x, y = (u - cx) / fx, (v - cy) / fy
    radius = np.hypot(x, y)
    stretch = np.interp(radius, seen, pinhole) / np.maximum(radius, 1e-9)
    maps = ((fx * x * stretch + cx).astype(np.float32), (fy * y * stretch + cy).astype(np.float32))
    image = cv2.remap(frame.image, *maps, cv2.INTER_LINEAR).astype(np.uint8, copy=False)
    matrix = camera.matrix.copy()
    matrix[:2, 2] -= left, top
    return replace(frame, image=image, camera=PinholeCamera(width, height, matrix))
