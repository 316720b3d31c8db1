"""Pinhole cameras in the place of a lens that is wider than one: the faces through which the networks see.

They stand level, whichever way the lens is tilted, and share its width evenly, as the pictures did that the networks
have learnt from. A lens that looks up or down has no horizon to stand on: it is seen through the faces of a cube.
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
"""Degrees across up to which one pinhole, `calibnet.geometry.rectification.central`, shows all that is of use."""
FACE_DEG = 80.0
"""Degrees across of a face at most, without its margin; KITTI's pictures have 82."""
MARGIN_DEG = 4.0
"""That a face sees beyond its share to either side, so that what is displaced over its border is still found."""
HIGHEST_DEG = 35.0
"""Degrees above and below the horizon that a face sees."""
STEP_DEG = 0.5
"""Step in which the angle is searched up to which the lens sees."""
SEEN = 0.5
"""Share of a direction's heights that the lens has to see for the direction to count."""
NARROWEST_DEG = 15.0
"""A face of which less is left, in either direction, is none."""
LEVEL = 0.5
"""Length of the optical axis along the horizon below which a lens looks up or down."""


def faces(
    camera: CameraModel, camera_from_lidar: Extrinsic, images: Sequence[NDArray[np.uint8]] = ()
) -> tuple[Rectification, ...]:
    """The faces of a lens, the one nearest to its axis first; none for a lens that one pinhole can show.

    Args:
        camera: with its lens.
        camera_from_lidar: a guess, 4x4, that says where the horizon is; the LiDAR's z axis points up.
        images: some pictures ``[H, W, 3]`` of the camera, by which borders that are always black are cut off.
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
    """``[3, 3]``, camera that stands level from the camera; None where that looks up or down.

    Args:
        up: ``[3]``, upward unit vector in the camera frame.
    """
    forward = np.array([0.0, 0.0, 1.0]) - up[2] * up
    if np.linalg.norm(forward) < LEVEL:
        return None
    forward = forward / np.linalg.norm(forward)
    return np.stack([np.cross(-up, forward), -up, forward])


def across(camera: CameraModel, level_from_camera: Rotation) -> float:
    """Degrees along the horizon that a lens sees."""
    return sum(_reaches(camera, level_from_camera))


def _reaches(camera: CameraModel, turn: Rotation) -> tuple[float, float]:
    """Degrees along the horizon that the lens sees without a gap, to the left and to the right of ahead."""
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
    """Which rays ``[N, 3]`` of the camera frame the picture shows."""
    seen = camera.see(rays)
    u, v = seen.pixels.T
    inside: NDArray[np.bool_] = (u > -0.5) & (u < camera.width - 0.5) & (v > -0.5) & (v < camera.height - 0.5)
    return seen.valid & inside


def _face(camera: CameraModel, turn: Rotation, half: tuple[float, float]) -> Rectification:
    """A pinhole, turned, of so many degrees to either side and up and down, as fine as the lens is in its middle."""
    focal = _fineness(camera, turn)
    across, high = (float(np.tan(np.radians(degrees))) for degrees in half)
    width, height = max(1, round(2 * focal * across)), max(1, round(2 * focal * high))
    matrix = np.array([[focal, 0.0, focal * across - 0.5], [0.0, focal, focal * high - 0.5], [0.0, 0.0, 1.0]])
    return Rectification(camera, PinholeCamera(width, height, matrix), turn)


def _fineness(camera: CameraModel, turn: Rotation) -> float:
    """Pixels a radian that the lens has where a face looks, of both directions the geometric mean."""
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
    """Ahead and to the four sides."""
    sides = [[0.0, 90.0, 0.0], [0.0, -90.0, 0.0], [90.0, 0.0, 0.0], [-90.0, 0.0, 0.0]]
    return [np.eye(3), *(rotation_from_vector(np.radians(side)) for side in sides)]
