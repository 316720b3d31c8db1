"""A camera with its lens: projects points into its own images, without rectification.

The models are those of ROS and Kalibr. Each maps the ray to a point onto a plane at distance 1, and the camera matrix
maps that plane to pixels.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from calibnet.geometry.camera import PinholeCamera
from calibnet.geometry.types import Floats, Intrinsics

LensModel = Literal["plumb_bob", "rational_polynomial", "equidistant", "omnidirectional", "double_sphere"]
LENS_MODELS: tuple[LensModel, ...] = get_args(LensModel)

COEFFICIENTS: dict[LensModel, tuple[int, ...]] = {
    "plumb_bob": (4, 5),
    "rational_polynomial": (8, 12, 14),
    "equidistant": (4,),
    "omnidirectional": (5,),
    "double_sphere": (2,),
}
"""Possible numbers of coefficients of each model. OpenCV's: k1 k2 p1 p2, then k3, then k4 k5 k6, then s1 to s4, then
tau_x tau_y. Equidistant (Kannala-Brandt, ``cv2.fisheye``): k1 to k4. Omnidirectional (Mei): xi k1 k2 p1 p2. Double
sphere: xi alpha.
"""

OWN_COEFFICIENTS: dict[LensModel, tuple[str, ...]] = {"omnidirectional": ("xi",), "double_sphere": ("xi", "alpha")}
"""Leading coefficients that files give under names of their own, apart from the distortion."""

SAMPLES = 2_000
"""Number of steps in the search for the angle at which a lens begins to fold its image back onto itself."""
WIDEST_PLANE = 20.0
"""Largest tangent of the angle from the axis in the search for OpenCV's lenses, which is 87 degrees."""


class Seen(NamedTuple):
    """Projected points: ``pixels [N, 2]``, and ``valid [N]``, whether the lens can show them at all."""

    pixels: Floats
    valid: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class CameraModel:
    """A camera: image size in pixels, 3x3 camera matrix, and lens.

    Attributes:
        width: width of the image.
        height: height of the image.
        matrix: maps the lens's plane to pixels; for ``omnidirectional``, its focal length is Mei's gamma.
        model: model of the lens.
        coefficients: coefficients as in `COEFFICIENTS`; zeros for rectified images.
    """

    width: int
    height: int
    matrix: Intrinsics = field(repr=False)
    model: LensModel = "plumb_bob"
    coefficients: Floats = field(default_factory=lambda: np.zeros(5))

    @classmethod
    def of(cls, camera: PinholeCamera) -> CameraModel:
        """The camera of rectified images."""
        return cls(camera.width, camera.height, camera.matrix)

    @property
    def is_pinhole(self) -> bool:
        """Whether straight lines are straight in its images."""
        return self.model in ("plumb_bob", "rational_polynomial") and not self.coefficients.any()

    @property
    def pinhole(self) -> PinholeCamera:
        """The pinhole camera of the same size and matrix."""
        return PinholeCamera(self.width, self.height, self.matrix)

    @property
    def named(self) -> dict[str, float]:
        """The coefficients that files give under names of their own."""
        names = OWN_COEFFICIENTS.get(self.model, ())
        return dict(zip(names, self.coefficients.tolist(), strict=False))

    @property
    def distortion(self) -> Floats:
        """The coefficients without those of `named`."""
        return self.coefficients[len(self.named) :]

    def same(self, other: CameraModel) -> bool:
        """Whether the other camera has the same size, matrix and lens."""
        return (
            (self.width, self.height, self.model) == (other.width, other.height, other.model)
            and np.array_equal(self.matrix, other.matrix)
            and np.array_equal(self.coefficients, other.coefficients)
        )

    def see(self, points: NDArray[np.floating]) -> Seen:
        """Project points ``[N, 3]`` of the camera frame, inside or outside the image."""
        plane, valid = _PLANES[self.model](points.astype(np.float64), self.coefficients)
        fx, skew, cx = self.matrix[0]
        fy, cy = self.matrix[1, 1:]
        x, y = plane.T
        return Seen(np.stack([fx * x + skew * y + cx, fy * y + cy], axis=1), valid)


def _of_opencv(points: Floats, coefficients: Floats) -> Seen:
    """OpenCV's model, which is not valid behind the camera or where its polynomial decreases."""
    import cv2  # imported late, since much that imports geometry needs no images

    ahead = points[:, 2] > 1e-9
    normalized = np.where(ahead[:, None], points[:, :2] / np.where(ahead, points[:, 2], 1.0)[:, None], 0.0)
    valid = ahead & (np.hypot(*normalized.T) < _widest_of_opencv(coefficients))
    rays = np.column_stack([np.where(valid[:, None], normalized, 0.0), np.ones(len(points))])
    if not len(rays):
        return Seen(np.zeros((0, 2)), valid)
    zero = np.zeros(3)
    plane = cv2.projectPoints(rays, zero, zero, np.eye(3), coefficients)[0].reshape(-1, 2)
    return Seen(np.asarray(plane, np.float64), valid)


def _widest_of_opencv(coefficients: Floats) -> float:
    """The largest tangent of an angle from the axis that the radial part of the lens can show."""
    k1, k2, _, _, k3, k4, k5, k6 = np.concatenate([coefficients, np.zeros(8)])[:8]
    radius = np.linspace(0.0, WIDEST_PLANE, SAMPLES)
    square = radius**2
    below = 1 + square * (k4 + square * (k5 + square * k6))
    with np.errstate(divide="ignore", invalid="ignore"):
        bent = radius * (1 + square * (k1 + square * (k2 + square * k3))) / below
    return _last_rising(radius, np.where(below > 0, bent, -1.0))


def _equidistant(points: Floats, coefficients: Floats) -> Seen:
    off_axis = np.hypot(points[:, 0], points[:, 1])
    angle = np.arctan2(off_axis, points[:, 2])
    angles = np.linspace(0.0, np.pi, SAMPLES)
    straight_behind = (off_axis < 1e-9) & (points[:, 2] <= 0)  # it maps to every direction of the image
    valid = (angle <= _last_rising(angles, _bent(angles, coefficients))) & ~straight_behind
    scale = _bent(angle, coefficients) / np.maximum(off_axis, 1e-12)
    return Seen(points[:, :2] * scale[:, None], valid)


def _bent(angle: Floats, coefficients: Floats) -> Floats:
    """Distance from the centre, on the plane, of a point at an angle from the axis in radians."""
    k1, k2, k3, k4 = coefficients
    square = angle**2
    bent: Floats = angle * (1 + square * (k1 + square * (k2 + square * (k3 + square * k4))))
    return bent


def _omnidirectional(points: Floats, coefficients: Floats) -> Seen:
    """Mei & Rives 2007: onto the unit sphere, then from a point ``xi`` behind its centre, then OpenCV's distortion."""
    xi, lens = coefficients[0], coefficients[1:]
    distance = np.maximum(np.linalg.norm(points, axis=1), 1e-12)
    depth = points[:, 2] / distance
    valid = depth > (-xi if xi <= 1 else -1 / xi) + 1e-6
    from_behind = np.where(valid, depth + xi, 1.0)
    rays = np.column_stack([points[:, :2] / (distance * from_behind)[:, None], np.ones(len(points))])
    plane, unfolded = _of_opencv(rays, lens)
    return Seen(plane, valid & unfolded)


def _double_sphere(points: Floats, coefficients: Floats) -> Seen:
    """The double sphere model, Usenko et al. 2018."""
    xi, alpha = coefficients
    x, y, z = points.T
    first = np.maximum(np.linalg.norm(points, axis=1), 1e-12)
    shifted = xi * first + z
    second = np.sqrt(x * x + y * y + shifted * shifted)
    weight = alpha / (1 - alpha) if alpha <= 0.5 else (1 - alpha) / alpha
    valid = z > -(weight + xi) / np.sqrt(2 * weight * xi + xi * xi + 1) * first
    depth = np.where(valid, alpha * second + (1 - alpha) * shifted, 1.0)
    return Seen(points[:, :2] / depth[:, None], valid)


_PLANES: dict[LensModel, Callable[[Floats, Floats], Seen]] = {
    "plumb_bob": _of_opencv,
    "rational_polynomial": _of_opencv,
    "equidistant": _equidistant,
    "omnidirectional": _omnidirectional,
    "double_sphere": _double_sphere,
}


def _last_rising(at: Floats, values: Floats) -> float:
    """The last position up to which values increase throughout."""
    falls = np.flatnonzero(np.diff(values) <= 0)
    return float(at[falls[0]] if len(falls) else at[-1])
