"""Rigid transforms as 4x4 matrices named ``target_from_source``; metres, radians, float64."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calibnet.geometry.types import Extrinsic, Floats, Matrix6, Rotation, Transform, Vector3, Vector6

AnyMatrix = TypeVar("AnyMatrix", Matrix6, Matrix6 | None)


def transform(rotation: ArrayLike, translation: ArrayLike) -> Transform:
    """Build a 4x4 transform from a 3x3 rotation and a translation of 3 metres."""
    matrix = np.eye(4)
    matrix[:3, :3] = rotation
    matrix[:3, 3] = translation
    return matrix


def invert(matrix: Transform) -> Transform:
    """Invert a rigid 4x4 transform: ``source_from_target``."""
    rotation = matrix[:3, :3]
    return transform(rotation.T, -rotation.T @ matrix[:3, 3])


def orthonormal(matrix: Transform) -> Transform:
    """Remove the rounding of single precision from the rotation of a 4x4 transform."""
    u, _, vt = np.linalg.svd(matrix[:3, :3])
    exact = matrix.copy()
    exact[:3, :3] = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
    return exact


def transform_points(target_from_source: Transform, points: NDArray[np.floating]) -> NDArray[np.floating]:
    """Map points ``[N, 3]`` from source to target, in the points' own precision.

    Not a matrix product, which is too slim to gain from the threads of BLAS; these would then spin for a tenth of a
    second and take the cores from the network's convolutions.
    """
    matrix = target_from_source.astype(points.dtype, copy=False)
    x, y, z = points.T
    moved = np.empty((3, len(points)), points.dtype)  # coordinate by coordinate, as they are read next
    for row, (a, b, c, offset) in zip(moved, matrix[:3], strict=True):
        row[:] = x * a + y * b + z * c + offset
    return moved.T


def rotation_from_euler_xyz(angles: ArrayLike) -> Rotation:
    """Rotation ``Rx(a) Ry(b) Rz(c)`` from three angles in radians."""
    a, b, c = np.asarray(angles, dtype=np.float64)
    ca, sa, cb, sb, cc, sc = np.cos(a), np.sin(a), np.cos(b), np.sin(b), np.cos(c), np.sin(c)
    return np.array(
        [
            [cb * cc, -cb * sc, sb],
            [ca * sc + sa * sb * cc, ca * cc - sa * sb * sc, -sa * cb],
            [sa * sc - ca * sb * cc, sa * cc + ca * sb * sc, ca * cb],
        ]
    )


def rotation_from_vector(vector: ArrayLike) -> Rotation:
    """The rotation by ``|vector|`` radians about ``vector`` (Rodrigues)."""
    axis = np.asarray(vector, dtype=np.float64)
    angle = float(np.linalg.norm(axis))
    if angle < 1e-12:
        return np.eye(3)
    cross = _cross(axis / angle)
    rotation: Rotation = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return rotation


def rotation_jacobian(vector: ArrayLike) -> Floats:
    """``J [3, 3]`` of a rotation vector: turning by ``vector``, then ``J d``, is turning by ``vector + d``, d small."""
    turn = np.asarray(vector, dtype=np.float64)
    angle, cross = float(np.linalg.norm(turn)), _cross(turn)
    if angle < 1e-4:  # the fractions below lose precision here
        return np.eye(3) + cross / 2
    straight, bent = (1 - np.cos(angle)) / angle**2, (angle - np.sin(angle)) / angle**3
    jacobian: Floats = np.eye(3) + straight * cross + bent * cross @ cross
    return jacobian


def rotation_vector(rotation: NDArray[np.floating]) -> Vector3:
    """The vector, in radians, of ``rotation_from_vector``; for a half turn, one of two possible vectors."""
    sine_axis, angle = _sine_axis(rotation), rotation_angle(rotation)
    if angle < 3.0:
        sine = float(np.linalg.norm(sine_axis))
        return sine_axis * (angle / sine) if sine > 1e-12 else sine_axis
    # near a half turn the sine loses precision, but the symmetric part is (1 - cos) times the axis' outer product
    even = 0.5 * (rotation + rotation.T) - np.cos(angle) * np.eye(3)
    axis = even[:, int(even.diagonal().argmax())]
    return np.asarray(np.copysign(angle, axis @ sine_axis) * axis / np.linalg.norm(axis), np.float64)


def pose_vector(correction: Transform) -> Vector6:
    """A 4x4 correction as ``(translation m, rotation vector rad)``."""
    return np.concatenate([correction[:3, 3], rotation_vector(correction[:3, :3])])


def pose_from_vector(vector: Vector6) -> Transform:
    """The inverse of `pose_vector`."""
    return transform(rotation_from_vector(vector[3:]), vector[:3])


def adjoint(camera_from_rig: Transform) -> Floats:
    """``[6, 6]``, maps a small motion ``(translation, rotation)`` of a rig to that of its camera."""
    rotation = camera_from_rig[:3, :3]
    return np.block([[rotation, _cross(camera_from_rig[:3, 3]) @ rotation], [np.zeros((3, 3)), rotation]])


def rotate6(rotation: Rotation) -> Floats:
    """``[6, 6]``, rotates vectors ``(translation, rotation)`` by a rotation ``[3, 3]``."""
    return np.kron(np.eye(2), rotation).astype(np.float64)


def rotated(matrix: AnyMatrix, rotation: Rotation) -> AnyMatrix:
    """A covariance or information ``[6, 6]`` of ``(translation, rotation)`` in rotated axes; None stays None."""
    if matrix is None:
        return matrix
    axes = rotate6(rotation)
    return np.asarray(axes @ matrix @ axes.T, np.float64)


def euler_xyz(rotation: NDArray[np.floating]) -> Vector3:
    """The three angles, in radians, of ``rotation_from_euler_xyz`` (for |b| < 90 degrees)."""
    return np.array(
        [
            np.arctan2(-rotation[1, 2], rotation[2, 2]),
            np.arcsin(np.clip(rotation[0, 2], -1.0, 1.0)),
            np.arctan2(-rotation[0, 1], rotation[0, 0]),
        ]
    )


def rotation_angle(rotation: NDArray[np.floating]) -> float:
    """Angle of a rotation in radians; exact near zero, where arccos of the trace is not."""
    return float(np.arctan2(np.linalg.norm(_sine_axis(rotation)), 0.5 * (np.trace(rotation) - 1.0)))


def _cross(vector: Vector3) -> Floats:
    """The matrix of the cross product with ``vector``."""
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def _sine_axis(rotation: NDArray[np.floating]) -> Vector3:
    """The rotation's axis, scaled by the sine of its angle."""
    return 0.5 * np.array(
        [
            rotation[2, 1] - rotation[1, 2],
            rotation[0, 2] - rotation[2, 0],
            rotation[1, 0] - rotation[0, 1],
        ]
    )


@dataclass(frozen=True)
class PoseError:
    """Difference between an estimated extrinsic and the reference, in the camera frame.

    ``roll`` turns about the camera's z (forward), ``pitch`` about x (right), ``yaw`` about y
    (down); per-axis values are signed.
    """

    rotation_deg: float
    translation_cm: float
    roll_deg: float
    pitch_deg: float
    yaw_deg: float
    x_cm: float
    y_cm: float
    z_cm: float


def degrees_and_cm(rotation_deg: float | None, translation_cm: float | None) -> str:
    """The size of an error, a motion or a standard deviation for the reader: ``0.27° / 11.0 cm``; empty if unknown."""
    if rotation_deg is None or translation_cm is None:
        return ""
    return f"{rotation_deg:.2f}° / {translation_cm:.1f} cm"


def pose_error(estimate: Extrinsic, reference: Extrinsic) -> PoseError:
    """Compare two ``camera_from_lidar``: angle of ``R_est R_ref^T`` and ``|t_est - t_ref|``."""
    rotation = estimate[:3, :3] @ reference[:3, :3].T
    offset = 100.0 * (estimate[:3, 3] - reference[:3, 3])
    pitch, yaw, roll = np.degrees(euler_xyz(rotation))
    return PoseError(
        rotation_deg=float(np.degrees(rotation_angle(rotation))),
        translation_cm=float(np.linalg.norm(offset)),
        roll_deg=float(roll),
        pitch_deg=float(pitch),
        yaw_deg=float(yaw),
        x_cm=float(offset[0]),
        y_cm=float(offset[1]),
        z_cm=float(offset[2]),
    )
