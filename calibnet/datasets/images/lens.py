"""Pictures as they are taken, and as the networks see them: through the pinhole cameras in the place of a lens."""

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
from calibnet.geometry.rectification import Rectification, central, degrees_across, said_of, without_black
from calibnet.geometry.types import Extrinsic

LOOKED_AT = 3
"""Pictures of a drive that tell which part of them a fisheye fills."""


class Picture(NamedTuple):
    """A rectified image ``[H, W, 3]`` RGB, the picture it was made from, if it was made from one, and its faces."""

    image: NDArray[np.uint8]
    original: Original | None = None
    faces: tuple[Face, ...] = ()


@dataclass(frozen=True)
class Lens:
    """How the pictures of a camera are rectified.

    Attributes:
        middle: the pinhole that looks ahead.
        faces: of a lens that is wider than that, see `calibnet.geometry.faces`.
    """

    middle: Rectification
    faces: tuple[Rectification, ...] = ()

    @classmethod
    def of(cls, camera: CameraModel, guess: Extrinsic, images: Sequence[NDArray[np.uint8]] = ()) -> Lens:
        """The lens of a camera.

        Args:
            camera: as it is.
            guess: of ``camera_from_lidar``, which says where the horizon is.
            images: some of its pictures ``[H, W, 3]``; a fisheye may fill only a circle of them.
        """
        middle = central(camera)
        if images and camera.model not in ("plumb_bob", "rational_polynomial"):
            middle = without_black(middle, images)
        return cls(middle, faces(camera, guess, images))

    @property
    def camera(self) -> CameraModel:
        """The camera as it is, lens included."""
        return self.middle.camera

    @property
    def pinhole(self) -> PinholeCamera:
        """The pinhole camera of the picture's middle."""
        return self.middle.pinhole

    @property
    def notes(self) -> tuple[str, ...]:
        """A sentence for the user where it is not seen through one pinhole."""
        if not self.faces:
            return said_of(self.middle)
        widths = "°, ".join(f"{degrees_across(face.pinhole):.0f}" for face in self.faces)
        return (
            f"The lens is wide: it is looked through by {len(self.faces)} pinhole cameras in its place ({widths}° "
            "across), which are solved as one; shown is the whole picture.",
        )

    def __call__(self, taken: NDArray[np.uint8]) -> Picture:
        """A picture ``[H, W, 3]`` RGB as it was taken, rectified."""
        seen = tuple(Face(face(taken), face.pinhole, face.pinhole_from_camera) for face in self.faces)
        if self.camera.is_pinhole:
            return Picture(taken, None, seen)
        return Picture(self.middle(taken), Original(taken, self.camera), seen)
