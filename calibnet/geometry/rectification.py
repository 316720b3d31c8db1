"""Pictures of any lens as a pinhole camera would have taken them, which is what the networks have learnt from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from calibnet.geometry.camera import PinholeCamera
from calibnet.geometry.camera_model import CameraModel
from calibnet.geometry.types import Floats, Rotation

WIDEST_DEG = 55.0
"""Angle from the axis, to the right and to the left, beyond which a pinhole spends its pixels on its corners."""
HIGHEST_DEG = 40.0
"""The same upwards and downwards, where there is more sky and bonnet to see than anything to calibrate by."""
BLACK = 10
"""Grey level up to which a pixel shows nothing: JPEG does not keep black exactly."""
FILLED = 0.5
"""Rows and columns that hold less than this share of the fullest are cut off."""
WORTH_SAYING_DEG = 5.0
"""Degrees that are left out, from which on a user is told."""
STEP_DEG = 0.25
"""Step in which the angle is searched up to which a lens sees."""


@dataclass(frozen=True, eq=False)
class Rectification:
    """A camera, and a pinhole camera in the same place that looks through its picture.

    Attributes:
        camera: as it is.
        pinhole: that the networks get.
        pinhole_from_camera: ``[3, 3]``, how the pinhole is turned; not at all by default.
    """

    camera: CameraModel
    pinhole: PinholeCamera
    pinhole_from_camera: Rotation = field(default_factory=lambda: np.eye(3), repr=False)

    def __call__(self, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """The picture ``[H, W, 3]`` of the pinhole; black where the lens sees nothing."""
        return cv2.remap(image, *self._maps, cv2.INTER_LINEAR).astype(np.uint8, copy=False)

    @cached_property
    def _maps(self) -> tuple[NDArray[np.int16], NDArray[np.uint16]]:
        """OpenCV's fixed-point maps from the pinhole's pixels to the camera's."""
        (fx, skew, cx), (_, fy, cy), _ = self.pinhole.matrix
        v, u = np.mgrid[: self.pinhole.height, : self.pinhole.width].astype(np.float64)
        y = (v - cy) / fy
        rays = np.stack([(u - cx - skew * y) / fx, y, np.ones_like(y)], axis=-1).reshape(-1, 3)
        seen = self.camera.see(rays @ self.pinhole_from_camera)  # transposed twice: its inverse
        pixels = np.where(seen.valid[:, None], seen.pixels, -10.0).reshape(*u.shape, 2).astype(np.float32)
        coarse, fine = cv2.convertMaps(pixels[..., 0], pixels[..., 1], cv2.CV_16SC2)
        return coarse.astype(np.int16, copy=False), fine.astype(np.uint16, copy=False)


def central(camera: CameraModel) -> Rectification:
    """The pinhole that looks ahead through a lens: of the same matrix for OpenCV's, and else as wide as is of use.

    Its focal length is that of the lens at its centre. It ends where the lens does, `WIDEST_DEG` and `HIGHEST_DEG`
    from the axis at the latest.
    """
    if camera.model in ("plumb_bob", "rational_polynomial"):
        return Rectification(camera, camera.pinhole)
    fx, fy = focal_at_centre(camera)
    left, right, up, down = (np.tan(np.radians(angle)) for angle in view(camera))
    width, height = max(1, round(fx * (left + right))), max(1, round(fy * (up + down)))
    matrix = np.array([[fx, 0.0, fx * left - 0.5], [0.0, fy, fy * up - 0.5], [0.0, 0.0, 1.0]])
    return Rectification(camera, PinholeCamera(width, height, matrix))


def without_black(rectification: Rectification, images: Sequence[NDArray[np.uint8]]) -> Rectification:
    """The same, without the border of the picture that is black in all images: many fisheyes fill only a circle.

    Points that fall on black would be matches that nothing answers.

    Args:
        rectification: whose pinhole may be cut.
        images: some pictures ``[H, W, 3]`` of the camera.
    """
    lit = np.max([rectification(image).max(axis=2) for image in images], axis=0) > BLACK
    if not lit.any():
        return rectification
    rows, columns = mostly(lit.sum(axis=1)), mostly(lit.sum(axis=0))
    matrix = rectification.pinhole.matrix.copy()
    matrix[:2, 2] -= columns.start, rows.start
    size = columns.stop - columns.start, rows.stop - rows.start
    return Rectification(rectification.camera, PinholeCamera(*size, matrix), rectification.pinhole_from_camera)


def mostly(lit: NDArray[np.integer]) -> slice:
    """From the first to the last of the rows, or columns, that hold a fair share of what the fullest does."""
    full = np.flatnonzero(lit >= FILLED * lit.max())
    return slice(int(full[0]), int(full[-1]) + 1)


def said_of(rectification: Rectification) -> tuple[str, ...]:
    """A sentence for the user where the pinhole does not see all that the lens does."""
    camera, pinhole = rectification.camera, rectification.pinhole
    if camera.is_pinhole:
        return ()
    left, right = widest(camera)
    seen = degrees_across(pinhole)
    if left + right < seen + WORTH_SAYING_DEG:
        return ()
    return (
        f"The lens sees {left + right:.0f}° across; the middle {seen:.0f}° are used, and shown is the whole picture.",
    )


def degrees_across(camera: PinholeCamera) -> float:
    """Angle that a pinhole camera sees from left to right."""
    focal, centre = camera.focal[0], camera.center[0]
    return float(np.degrees(np.arctan((centre + 0.5) / focal) + np.arctan((camera.width - 0.5 - centre) / focal)))


def focal_at_centre(camera: CameraModel) -> tuple[float, float]:
    """Focal lengths, in pixels, of the pinhole that shows things at the centre as large as the lens does."""
    small = 1e-4
    centre, right, down = camera.see(np.array([[0.0, 0.0, 1.0], [small, 0.0, 1.0], [0.0, small, 1.0]])).pixels
    return float((right[0] - centre[0]) / small), float((down[1] - centre[1]) / small)


def view(camera: CameraModel) -> tuple[float, float, float, float]:
    """Degrees from the axis that a pinhole of use sees to the left, to the right, upwards and downwards."""
    return (
        _reach(camera, [-1.0, 0.0], WIDEST_DEG),
        _reach(camera, [1.0, 0.0], WIDEST_DEG),
        _reach(camera, [0.0, -1.0], HIGHEST_DEG),
        _reach(camera, [0.0, 1.0], HIGHEST_DEG),
    )


def widest(camera: CameraModel) -> tuple[float, float]:
    """Degrees from the axis that the lens sees, in the picture, to the left and to the right."""
    return _reach(camera, [-1.0, 0.0], 179.0), _reach(camera, [1.0, 0.0], 179.0)


def _reach(camera: CameraModel, direction: list[float], most: float) -> float:
    """Degrees from the axis up to which the picture shows a direction; at least one step."""
    angles = np.radians(np.arange(STEP_DEG, most + STEP_DEG / 2, STEP_DEG))
    rays: Floats = np.column_stack([np.outer(np.sin(angles), direction), np.cos(angles)])
    seen = camera.see(rays)
    u, v = seen.pixels.T
    shown = seen.valid & (u > -0.5) & (u < camera.width - 0.5) & (v > -0.5) & (v < camera.height - 0.5)
    count = len(shown) if shown.all() else int(shown.argmin())
    return max(count, 1) * STEP_DEG
