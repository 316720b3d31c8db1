"""Rectifies images of any lens to those of a pinhole camera, on which the networks were trained."""

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
"""Largest angle to the left and right in degrees, beyond which a pinhole wastes pixels on its corners."""
HIGHEST_DEG = 40.0
"""Largest angle up and down in degrees, beyond which there is mostly sky and bonnet."""
BLACK = 10
"""Largest grey level of a black pixel, since JPEG does not keep black exactly."""
FILLED = 0.5
"""Smallest share of filled pixels of a row or column, relative to the fullest; others are cropped."""
WORTH_SAYING_DEG = 5.0
"""Smallest unused angle in degrees about which the user is informed."""
STEP_DEG = 0.25
"""Step of the search for the lens's field of view, in degrees."""


@dataclass(frozen=True, eq=False)
class Rectification:
    """A camera, and a pinhole camera in the same place whose image is resampled from its image.

    Attributes:
        camera: the camera with its lens.
        pinhole: the pinhole camera for the networks.
        pinhole_from_camera: ``[3, 3]``, rotation of the pinhole; the identity by default.
    """

    camera: CameraModel
    pinhole: PinholeCamera
    pinhole_from_camera: Rotation = field(default_factory=lambda: np.eye(3), repr=False)

    def __call__(self, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """The image ``[H, W, 3]`` of the pinhole, black where the lens sees nothing."""
        return cv2.remap(image, *self._maps, cv2.INTER_LINEAR).astype(np.uint8, copy=False)

    @cached_property
    def _maps(self) -> tuple[NDArray[np.int16], NDArray[np.uint16]]:
        """OpenCV's fixed-point maps from the pinhole's pixels to the camera's."""
        (fx, skew, cx), (_, fy, cy), _ = self.pinhole.matrix
        v, u = np.mgrid[: self.pinhole.height, : self.pinhole.width].astype(np.float64)
        y = (v - cy) / fy
        rays = np.stack([(u - cx - skew * y) / fx, y, np.ones_like(y)], axis=-1).reshape(-1, 3)
        seen = self.camera.see(rays @ self.pinhole_from_camera)  # multiplied by the inverse
        pixels = np.where(seen.valid[:, None], seen.pixels, -10.0).reshape(*u.shape, 2).astype(np.float32)
        coarse, fine = cv2.convertMaps(pixels[..., 0], pixels[..., 1], cv2.CV_16SC2)
        return coarse.astype(np.int16, copy=False), fine.astype(np.uint16, copy=False)


def central(camera: CameraModel) -> Rectification:
    """The pinhole along the axis of a lens, with the same matrix for OpenCV's lenses, otherwise as wide as useful.

    Its focal length is that of the lens at its centre. Its field of view is that of the lens, limited to `WIDEST_DEG`
    and `HIGHEST_DEG` from the axis.
    """
    if camera.model in ("plumb_bob", "rational_polynomial"):
        return Rectification(camera, camera.pinhole)
    fx, fy = focal_at_centre(camera)
    left, right, up, down = (np.tan(np.radians(angle)) for angle in view(camera))
    width, height = max(1, round(fx * (left + right))), max(1, round(fy * (up + down)))
    matrix = np.array([[fx, 0.0, fx * left - 0.5], [0.0, fy, fy * up - 0.5], [0.0, 0.0, 1.0]])
    return Rectification(camera, PinholeCamera(width, height, matrix))


def without_black(rectification: Rectification, images: Sequence[NDArray[np.uint8]]) -> Rectification:
    """The rectification without borders that are black in all images, since many fisheyes fill only a circle.

    Points on black pixels could not be matched.

    Args:
        rectification: rectification whose pinhole may be cropped.
        images: some images ``[H, W, 3]`` of the camera.
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
    """The range of rows, or columns, from the first to the last one that is filled relative to the fullest."""
    full = np.flatnonzero(lit >= FILLED * lit.max())
    return slice(int(full[0]), int(full[-1]) + 1)


def field_of_view_note(rectification: Rectification) -> tuple[str, ...]:
    """A sentence for the user if the pinhole does not see all that the lens does."""
    camera, pinhole = rectification.camera, rectification.pinhole
    if camera.is_pinhole:
        return ()
    left, right = widest(camera)
    seen = degrees_across(pinhole)
    if left + right < seen + WORTH_SAYING_DEG:
        return ()
    return (
        f"The lens sees {left + right:.0f}° across; the middle {seen:.0f}° are used, but the whole image is shown.",
    )


def degrees_across(camera: PinholeCamera) -> float:
    """Horizontal field of view of a pinhole camera in degrees."""
    focal, centre = camera.focal[0], camera.center[0]
    return float(np.degrees(np.arctan((centre + 0.5) / focal) + np.arctan((camera.width - 0.5 - centre) / focal)))


def focal_at_centre(camera: CameraModel) -> tuple[float, float]:
    """Focal lengths, in pixels, of the pinhole with the lens's scale at the centre."""
    small = 1e-4
    centre, right, down = camera.see(np.array([[0.0, 0.0, 1.0], [small, 0.0, 1.0], [0.0, small, 1.0]])).pixels
    return float((right[0] - centre[0]) / small), float((down[1] - centre[1]) / small)


def view(camera: CameraModel) -> tuple[float, float, float, float]:
    """Useful field of view of a pinhole to the left, right, up and down, in degrees from the axis."""
    return (
        _reach(camera, [-1.0, 0.0], WIDEST_DEG),
        _reach(camera, [1.0, 0.0], WIDEST_DEG),
        _reach(camera, [0.0, -1.0], HIGHEST_DEG),
        _reach(camera, [0.0, 1.0], HIGHEST_DEG),
    )


def widest(camera: CameraModel) -> tuple[float, float]:
    """Field of view of the lens to the left and to the right within the image, in degrees from the axis."""
    return _reach(camera, [-1.0, 0.0], 179.0), _reach(camera, [1.0, 0.0], 179.0)


def _reach(camera: CameraModel, direction: list[float], most: float) -> float:
    """Field of view of the image in a direction, in degrees from the axis; at least one step."""
    angles = np.radians(np.arange(STEP_DEG, most + STEP_DEG / 2, STEP_DEG))
    rays: Floats = np.column_stack([np.outer(np.sin(angles), direction), np.cos(angles)])
    seen = camera.see(rays)
    u, v = seen.pixels.T
    shown = seen.valid & (u > -0.5) & (u < camera.width - 0.5) & (v > -0.5) & (v < camera.height - 0.5)
    count = len(shown) if shown.all() else int(shown.argmin())
    return max(count, 1) * STEP_DEG
