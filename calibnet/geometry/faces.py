"""Replaces a wide lens by several pinhole cameras in its place, the faces through which the networks see.

Faces are level, however the lens is tilted, like the training images, and share its width evenly. A lens that looks up
or down has no horizon, and is replaced by the faces of a cube.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from calibnet.geometry.camera import PinholeCamera
from calibnet.geometry.camera_model import CameraModel
from calibnet.geometry.rectification import Rectification, degrees_across, without_black
from calibnet.geometry.se3 import rotation_from_vector
from calibnet.geometry.types import Extrinsic, Floats, Rotation, Vector3

WIDE_DEG = 115.0
"""Largest horizontal field of view in degrees for which one pinhole, `calibnet.geometry.rectification.central`,
suffices."""
FACE_DEG = 80.0
"""Largest horizontal field of view of a face in degrees, without its margin; KITTI's images have 82."""
MARGIN_DEG = 4.0
"""Margin of a face to either side in degrees, so that points displaced over its border are still found."""
HIGHEST_DEG = 35.0
"""Field of view of a face above and below the horizon, in degrees."""
STEP_DEG = 0.5
"""Step of the search for the lens's field of view, in degrees."""
SEEN = 0.5
"""Share of the elevations of a direction that the lens must see for the direction to count."""
NARROWEST_DEG = 15.0
"""Smallest field of view of a face in either direction, in degrees."""
LEVEL = 0.5
"""Horizontal part of the optical axis below which a lens looks up or down."""


def faces(
    camera: CameraModel, camera_from_lidar: Extrinsic, images: Sequence[NDArray[np.uint8]] = ()
) -> tuple[Rectification, ...]:
    """The faces of a lens, the one nearest to its axis first; none for a lens that one pinhole can replace.

    Args:
        camera: camera with its lens.
        camera_from_lidar: a guess, 4x4, which gives the horizon, since the LiDAR's z axis points up.
        images: some images ``[H, W, 3]`` of the camera, by which borders that are always black are cut off.
    """
    lit = images or [np.full((camera.height, camera.width, 3), 255, np.uint8)]
    turn = level(camera_from_lidar[:3, 2])
    if turn is None:
        turns, half = _cube(), (45.0 + MARGIN_DEG, 45.0 + MARGIN_DEG)
        if across(camera, np.eye(3)) <= WIDE_DEG:
            return ()
    else:
        left, right = _reaches(camera, turn)
        if left + right <= WIDE_DEG:
            return ()
        count = int(np.ceil((left + right) / FACE_DEG))
        width = (left + right) / count
        middles = -left + width * (np.arange(count) + 0.5)
        turns = [_about_y(-degrees) @ turn for degrees in sorted(middles.tolist(), key=abs)]
        half = width / 2 + MARGIN_DEG, HIGHEST_DEG
    found = [without_black(_face(camera, one, half), lit) for one in turns if _looks_at(camera, one)]
    return tuple(face for face in found if _is_of_use(face.pinhole))


def level(up: Vector3) -> Rotation | None:
    """``[3, 3]``, rotation from the camera to a level one; None if it looks up or down.

    Args:
        up: ``[3]``, upward unit vector in the camera frame.
    """
    forward = np.array([0.0, 0.0, 1.0]) - up[2] * up
    if np.linalg.norm(forward) < LEVEL:
        return None
    forward = forward / np.linalg.norm(forward)
    return np.stack([np.cross(-up, forward), -up, forward])


def across(camera: CameraModel, level_from_camera: Rotation) -> float:
    """Horizontal field of view of a lens in degrees."""
    return sum(_reaches(camera, level_from_camera))


def _reaches(camera: CameraModel, turn: Rotation) -> tuple[float, float]:
    """Degrees along the horizon that the lens sees without a gap, to the left and to the right of its axis."""
    azimuths = np.arange(0.0, 180.0, STEP_DEG)
    heights = np.radians(np.linspace(-HIGHEST_DEG, HIGHEST_DEG, 15))

    def reach(side: float) -> float:
        right, up = np.meshgrid(np.radians(side * azimuths), heights, indexing="ij")
        rays = np.stack([np.sin(right) * np.cos(up), -np.sin(up), np.cos(right) * np.cos(up)], axis=-1)
        shown = _shown(camera, rays.reshape(-1, 3) @ turn).reshape(right.shape)
        counts = shown.mean(axis=1) >= SEEN
        return STEP_DEG * (len(counts) if counts.all() else int(counts.argmin()))

    return reach(-1.0), reach(1.0)


def _shown(camera: CameraModel, rays: Floats) -> NDArray[np.bool_]:
    """Whether the image shows each ray ``[N, 3]`` of the camera frame."""
    seen = camera.see(rays)
    u, v = seen.pixels.T
    inside: NDArray[np.bool_] = (u > -0.5) & (u < camera.width - 0.5) & (v > -0.5) & (v < camera.height - 0.5)
    return seen.valid & inside


def _face(camera: CameraModel, turn: Rotation, half: tuple[float, float]) -> Rectification:
    """A turned pinhole of a given half field of view across and up, with the lens's resolution at its centre."""
    focal = _fineness(camera, turn)
    across, high = (float(np.tan(np.radians(degrees))) for degrees in half)
    width, height = max(1, round(2 * focal * across)), max(1, round(2 * focal * high))
    matrix = np.array([[focal, 0.0, focal * across - 0.5], [0.0, focal, focal * high - 0.5], [0.0, 0.0, 1.0]])
    return Rectification(camera, PinholeCamera(width, height, matrix), turn)


def _fineness(camera: CameraModel, turn: Rotation) -> float:
    """Resolution of the lens at the centre of a face in pixels per radian, the geometric mean of both directions."""
    small = 1e-3
    ahead, right, down = camera.see(np.array([[0, 0, 1.0], [small, 0, 1], [0, small, 1]]) @ turn).pixels
    (a, b), (c, d) = (right - ahead) / small, (down - ahead) / small
    return float(np.sqrt(abs(a * d - b * c)))


def _looks_at(camera: CameraModel, turn: Rotation) -> bool:
    return bool(camera.see(np.array([[0.0, 0.0, 1.0]]) @ turn).valid[0])


def _is_of_use(pinhole: PinholeCamera) -> bool:
    upright = PinholeCamera(pinhole.height, pinhole.width, pinhole.matrix[[1, 0, 2]][:, [1, 0, 2]])
    return min(degrees_across(pinhole), degrees_across(upright)) >= NARROWEST_DEG


def _about_y(degrees: float) -> Rotation:
    return rotation_from_vector([0.0, np.radians(degrees), 0.0])


def _cube() -> list[Rotation]:
    """The rotations of five faces: ahead and to the four sides."""
    sides = [[0.0, 90.0, 0.0], [0.0, -90.0, 0.0], [90.0, 0.0, 0.0], [-90.0, 0.0, 0.0]]
    return [np.eye(3), *(rotation_from_vector(np.radians(side)) for side in sides)]
