"""Rectifies images for the networks, by one or more pinhole cameras in the place of a lens."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from calibnet.datasets.frame import Face, Original
from calibnet.geometry import PinholeCamera
from calibnet.geometry.camera_model import CameraModel
from calibnet.geometry.faces import faces
from calibnet.geometry.rectification import Rectification, central, degrees_across, field_of_view_note, without_black
from calibnet.geometry.types import Extrinsic

LOOKED_AT = 3
"""Number of images of a drive from which the part filled by a fisheye is found."""


class RectifiedImage(NamedTuple):
    """A rectified image ``[H, W, 3]`` RGB, the original image if it was rectified here, and its faces."""

    image: NDArray[np.uint8]
    original: Original | None = None
    faces: tuple[Face, ...] = ()


@dataclass(frozen=True)
class Lens:
    """Rectification of a camera's images.

    Attributes:
        middle: the pinhole along the optical axis.
        faces: faces of a wider lens, see `calibnet.geometry.faces`.
    """

    middle: Rectification
    faces: tuple[Rectification, ...] = ()

    @classmethod
    def of(cls, camera: CameraModel, guess: Extrinsic, images: Sequence[NDArray[np.uint8]] = ()) -> Lens:
        """The lens of a camera.

        Args:
            camera: the camera with its lens.
            guess: guess of ``camera_from_lidar``, which gives the horizon.
            images: some of its images ``[H, W, 3]``, of which a fisheye may fill only a circle.
        """
        middle = central(camera)
        if images and camera.model not in ("plumb_bob", "rational_polynomial"):
            middle = without_black(middle, images)
        return cls(middle, faces(camera, guess, images))

    @property
    def camera(self) -> CameraModel:
        """The camera, lens included."""
        return self.middle.camera

    @property
    def pinhole(self) -> PinholeCamera:
        """The pinhole camera along the optical axis."""
        return self.middle.pinhole

    @property
    def notes(self) -> tuple[str, ...]:
        """A sentence for the user if one pinhole does not show all of it."""
        if not self.faces:
            return field_of_view_note(self.middle)
        widths = "°, ".join(f"{degrees_across(face.pinhole):.0f}" for face in self.faces)
        return (
            f"The lens is wide: it is replaced by {len(self.faces)} pinhole cameras in its place ({widths}° "
            "across), which are solved as one; the whole image is shown.",
        )

    def __call__(self, taken: NDArray[np.uint8]) -> RectifiedImage:
        """Rectify an image ``[H, W, 3]`` RGB."""
        seen = tuple(Face(face(taken), face.pinhole, face.pinhole_from_camera) for face in self.faces)
        if self.camera.is_pinhole:
            return RectifiedImage(taken, None, seen)
        return RectifiedImage(self.middle(taken), Original(taken, self.camera), seen)
