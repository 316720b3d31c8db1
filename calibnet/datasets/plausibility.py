"""Checks that cost nothing: whether a camera matrix, a lens or an extrinsic can be what it is taken to be.

Those of scans and of images are in `clouds.plausibility` and `images.plausibility`.

Each returns what cannot be right in one sentence, with a short name for machines, or None. What no sensor could have is
refused as it is read (`refuse`); what some sensor might have is kept beside the frame, and is the first suspect when
image and scan do not fit (`suspicion`). The limits leave out no sensor that we know of.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calibnet.errors import ImplausibleError
from calibnet.geometry import PinholeCamera
from calibnet.geometry.camera_model import CameraModel
from calibnet.geometry.types import Extrinsic, Intrinsics

VIEW_DEG = (8.0, 150.0)
"""Smallest and largest horizontal field of view of a pinhole camera, in degrees."""
SQUARE, STRETCHED = 1.25, 2.5
"""Largest ratio of the focal lengths of images with square pixels, and of images resized to another aspect ratio."""
MIDDLE, CROPPED = (0.25, 0.75), (-0.5, 1.5)
"""Range of the principal point relative to width and height, and the range for a cropped image."""
SAME_SHAPE, OTHER_SIZE, SURELY_OTHER = 0.1, 1.35, 1.8
"""A matrix belongs to another size if its factors in both directions agree within the first and exceed the second;
above the third this is certain."""
LONG_ARM_M, LONGEST_ARM_M = 5.0, 30.0
"""Distance between camera and LiDAR that only lorries exceed, and the largest, in metres; a lorry is 20 m long."""
STEEP = 0.9
"""Sine of the elevation above which a camera counts as looking along the LiDAR's z axis."""
GRID, SEEN = 40, 0.5
"""Number of samples across a rectified image, and the smallest share of them that any real lens fills."""
BLACK = (0.05, 0.2)
"""Largest shares of a side by which a rectified image may exceed the original on one side, and on the other."""


@dataclass(frozen=True)
class Implausible:
    """A finding that cannot be right, or is unlikely.

    Attributes:
        name: ``focal-length``, ``principal-point``, ``picture-size``, ``distortion``, ``units``, ``axes``,
            ``accumulated``, ``bit-depth`` or ``bayer``.
        text: a sentence without full stop: the finding; what to do.
        certain: whether no sensor can have it, so that the input is refused.
    """

    name: str
    text: str
    certain: bool = False


def refuse(found: Iterable[Implausible | None], where: str | Path) -> tuple[Implausible, ...]:
    """The unlikely findings.

    Raises:
        ImplausibleError: a finding is certain; the message names ``where`` it is.
    """
    remarks = tuple(remark for remark in found if remark is not None)
    for remark in remarks:
        if remark.certain:
            raise ImplausibleError(f"{where}: {remark.text}.", remark.name)
    return remarks


def suspicion(remarks: Iterable[Implausible], otherwise: str) -> str:
    """What to check if image and scan do not fit: the unlikely findings or, without any, the usual causes."""
    return ", or ".join(remark.text for remark in remarks) or otherwise


def of_camera(camera: PinholeCamera) -> list[Implausible | None]:
    """All checks of a camera matrix; the first finding is the best explanation."""
    return [focal_length(camera) or pixel_shape(camera), image_size(camera) or principal_point(camera)]


def of_lens(camera: CameraModel) -> list[Implausible | None]:
    """All checks of a lens, and of its camera matrix if that is not the one of the rectified image."""
    if camera.model in ("plumb_bob", "rational_polynomial"):
        return (
            [] if any(of_camera(camera.pinhole)) else [distortion(camera)]
        )  # a wrong matrix would be blamed on the lens
    return [pixel_shape(camera.pinhole), image_size(camera.pinhole) or principal_point(camera.pinhole)]


def of_extrinsic(camera_from_lidar: Extrinsic) -> list[Implausible | None]:
    """All checks of an extrinsic."""
    return [arm(camera_from_lidar), viewing_direction(camera_from_lidar)]


def focal_length(camera: PinholeCamera) -> Implausible | None:
    """Check the focal length against the width of the image."""
    focal, width = camera.focal[0], camera.width
    view = float(np.degrees(2 * np.arctan(width / 2 / focal)))
    if VIEW_DEG[0] <= view <= VIEW_DEG[1]:
        return None
    guess = "give it in pixels"
    if focal < 5:
        guess = f"it seems to be a share of the width, so multiply by that ({focal * width:.0f} px)"
    elif focal < 100:
        guess = "it seems to be in millimetres, so divide it by the size of a pixel on the sensor"
    text = f"the focal length {focal:g} px of an image {width} px wide would see {view:.0f} degrees; {guess}"
    return Implausible("focal-length", text, certain=True)


def distortion(camera: CameraModel) -> Implausible | None:
    """Check that a lens fills enough of the rectified image, which has the size and matrix of the original."""
    width, height = camera.pinhole.width, camera.pinhole.height
    u, v = np.meshgrid(np.linspace(0, width - 1, GRID), np.linspace(0, height - 1, GRID))
    pixels = np.column_stack([u.ravel(), v.ravel(), np.ones(u.size)])
    with np.errstate(over="ignore", invalid="ignore"):
        seen = camera.see(pixels @ np.linalg.inv(camera.matrix).T)
        inside = ((seen.pixels >= 0) & (seen.pixels < (width, height))).all(axis=1) & seen.valid
    if inside.mean() >= SEEN:
        return None
    text = (
        f"with these distortion coefficients only {inside.mean():.0%} of the rectified image would show anything; "
        "give those of this camera, in the order of the lens model"
    )
    return Implausible("distortion", text, certain=True)


def rectification(camera: CameraModel, rotation: NDArray[np.float64], projection: Intrinsics) -> Implausible | None:
    """Check that a camera's matrix and that of its rectified images belong to images of the same size.

    A rectified image that exceeds the original far on one side, but not on the other, was made from a larger one, as in
    bags of KITTI's rectified images, which have the matrix and lens of the original ones.

    Args:
        camera: camera of the original images.
        rotation: ``[3, 3]``, rotation from that camera to the rectified one.
        projection: ``[3, 3]``, matrix of the rectified camera, for images of the same size; ignored if it is not a
            camera matrix, as from drivers that leave it empty.
    """
    if not (np.isfinite(projection).all() and (projection[2] == (0, 0, 1)).all() and projection[1, 0] == 0):
        return None
    if not (np.diag(projection) > 0).all() or not rotation.any():
        return None
    right, bottom, (u, v) = camera.width - 1.0, camera.height - 1.0, projection[:2, 2]
    middles = np.array([[0.0, v, 1.0], [right, v, 1.0], [u, 0.0, 1.0], [u, bottom, 1.0]])
    with np.errstate(all="ignore"):
        seen = camera.see(middles @ np.linalg.inv(projection).T @ rotation)
    (left, _), (far, _), (_, top), (_, low) = seen.pixels / (camera.width, camera.height)
    beyond = [sorted((-start, end - 1.0)) for start, end in ((left, far), (top, low))]
    if not seen.valid.all() or not any(near < BLACK[0] and BLACK[1] < more for near, more in beyond):
        return None
    text = (
        "the CameraInfo has a matrix K of larger images than its matrix P, so these seem to be rectified already, "
        "whatever their topic is called (kitti2bag writes such); give their calibration, P without distortion, with "
        "--guess FILE"
    )
    return Implausible("picture-size", text)


def pixel_shape(camera: PinholeCamera) -> Implausible | None:
    """Check the ratio of the focal lengths."""
    ratio = camera.focal[0] / camera.focal[1]
    if 1 / SQUARE <= ratio <= SQUARE:
        return None
    text = (
        f"the focal lengths {camera.focal[0]:g} and {camera.focal[1]:g} px make pixels {ratio:.2g} times as high as "
        "wide; unless the image was resized to another shape, give the same units for both"
    )
    return Implausible("focal-length", text, certain=not 1 / STRETCHED <= ratio <= STRETCHED)


def image_size(camera: PinholeCamera) -> Implausible | None:
    """Check that the principal point is not the middle of an image of another size."""
    across, down = 2 * camera.center[0] / camera.width, 2 * camera.center[1] / camera.height
    factor = (max(across, 0.0) * max(down, 0.0)) ** 0.5
    if not factor or abs(across / down - 1) > SAME_SHAPE or 1 / OTHER_SIZE < factor < OTHER_SIZE:
        return None
    text = (
        f"the principal point ({camera.center[0]:g}, {camera.center[1]:g}) is the middle of an image of about "
        f"{2 * camera.center[0]:.0f}x{2 * camera.center[1]:.0f}, and this one is {camera.width}x{camera.height}; "
        "scale the camera matrix by the factor that the image was resized by"
    )
    return Implausible("picture-size", text, certain=not 1 / SURELY_OTHER < factor < SURELY_OTHER)


def principal_point(camera: PinholeCamera) -> Implausible | None:
    """Check that the principal point is near the middle of the image."""
    shares = camera.center[0] / camera.width, camera.center[1] / camera.height
    if all(MIDDLE[0] <= share <= MIDDLE[1] for share in shares):
        return None
    text = (
        f"the principal point ({camera.center[0]:g}, {camera.center[1]:g}) is far from the middle of an image of "
        f"{camera.width}x{camera.height}; unless the image was cropped, give the camera matrix of this very size"
    )
    return Implausible("principal-point", text, certain=not all(CROPPED[0] <= share <= CROPPED[1] for share in shares))


def arm(camera_from_lidar: Extrinsic) -> Implausible | None:
    """Check the distance between camera and LiDAR."""
    metres = float(np.linalg.norm(camera_from_lidar[:3, 3]))
    if metres <= LONG_ARM_M:
        return None
    text = f"camera_from_lidar puts {metres:.0f} m between camera and LiDAR; give its translation in metres"
    return Implausible("units", text, certain=metres > LONGEST_ARM_M)


def viewing_direction(camera_from_lidar: Extrinsic) -> Implausible | None:
    """Check that the camera looks roughly horizontally, and is not on its side because the matrix is inverted."""
    towards_up = float(camera_from_lidar[2, 2])
    if abs(towards_up) > STEEP:
        text = (
            f"under camera_from_lidar the camera looks straight {'up' if towards_up > 0 else 'down'}, along the "
            "LiDAR's z axis; map x forward, y left, z up to x right, y down, z forward, which for a camera that looks "
            "ahead is [0, -1, 0], [0, 0, -1], [1, 0, 0]"
        )
        return Implausible("axes", text)
    if abs(camera_from_lidar[0, 2]) > STEEP and -camera_from_lidar[2, 1] > STEEP:
        text = (
            "under camera_from_lidar the camera lies on its side, under its inverse it stands upright; if it is "
            "lidar_from_camera, invert it"
        )
        return Implausible("axes", text)
    return None
