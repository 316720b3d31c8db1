"""What every dataset yields (`Frame`) and what every dataset is (`Sequence`)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from calibnet.datasets.plausibility import Implausible
from calibnet.geometry import PinholeCamera, transform
from calibnet.geometry.camera_model import CameraModel
from calibnet.geometry.types import Extrinsic, Rotation


class Original(NamedTuple):
    """A picture as it was taken, ``[H, W, 3]`` uint8 RGB, and the camera that took it, lens included."""

    image: NDArray[np.uint8]
    camera: CameraModel


class Face(NamedTuple):
    """What a pinhole camera in the place of a wide lens sees: ``[H, W, 3]`` uint8 RGB, and how it is turned."""

    image: NDArray[np.uint8]
    camera: PinholeCamera
    face_from_camera: Rotation


@dataclass(frozen=True, eq=False)
class Frame:
    """One synchronised image and scan.

    Attributes:
        index: position in its sequence, as the files are numbered.
        timestamp: seconds since the sequence's first frame.
        image: ``[H, W, 3]`` uint8, RGB, rectified.
        points: ``[N, 4]`` float32, finite: x forward, y left, z up in metres, intensity 0..1.
        camera: intrinsics of ``image``.
        camera_from_lidar: the dataset's own extrinsic, 4x4 float64; the reference where the
            dataset is calibrated, a starting guess where the user's sensors are not yet.
        source: the image's path (or a description), to name in messages.
        remarks: what is unlikely about it, though some sensor may be so: the first suspects when it does not fit.
        original: the picture before it was rectified; None where it was rectified already.
        faces: of a lens that is wider than a pinhole, which are calibrated by instead of ``image``, its middle.
    """

    index: int
    timestamp: float
    image: NDArray[np.uint8] = field(repr=False)
    points: NDArray[np.float32] = field(repr=False)
    camera: PinholeCamera
    camera_from_lidar: Extrinsic = field(repr=False)
    source: str = ""
    remarks: tuple[Implausible, ...] = ()
    original: Original | None = field(default=None, repr=False)
    faces: tuple[Face, ...] = field(default=(), repr=False)

    def through(self, face: Face) -> Frame:
        """What one of its faces sees, as a frame of its own."""
        turned = transform(face.face_from_camera, (0.0, 0.0, 0.0)) @ self.camera_from_lidar
        image, camera = face.image, face.camera
        return replace(self, image=image, camera=camera, camera_from_lidar=turned, original=None, faces=())

    def changed(self, change: Callable[[Frame], Frame]) -> Frame:
        """A change of a frame, and the same change of the picture of each face."""
        faces = [(face, change(self.through(face))) for face in self.faces]
        return replace(
            change(self), faces=tuple(face._replace(image=new.image, camera=new.camera) for face, new in faces)
        )

    @property
    def as_taken(self) -> Original:
        """The picture and the camera that the user knows: what is shown, recorded and exported."""
        return self.original or Original(self.image, CameraModel.of(self.camera))


class Frames(Protocol):
    """What a drive is solved from: a `Sequence`, or a list of frames."""

    def __len__(self) -> int:
        """Number of frames."""
        ...

    def __getitem__(self, position: int, /) -> Frame:
        """Read one frame."""
        ...


@runtime_checkable
class Numbered(Protocol):
    """Frames that know how each is numbered before it is read."""

    def index_of(self, position: int, /) -> int:
        """`Frame.index` of the frame at a position."""
        ...


def index_of(frames: Frames, position: int) -> int:
    """How a frame that may be unreadable is numbered: by `Frame.index`, or its position where the frames do not say."""
    return frames.index_of(position) if isinstance(frames, Numbered) else position


@runtime_checkable
class Sequence(Protocol):
    """Frames of one camera and one LiDAR on one mount, read lazily.

    One whose frames are not numbered by their positions is `Numbered` too, so that a frame that cannot be read is named
    as the others are.

    Attributes:
        name: for titles and file names, for instance ``"kitti-odometry/04"``.
        rig: the sensors and mount the frames come from, for instance ``"KITTI 2011_09_30, camera 2"``.
    """

    name: str
    rig: str

    def __len__(self) -> int:
        """Number of frames."""
        ...

    def __getitem__(self, position: int) -> Frame:
        """Read one frame; ``DatasetError`` names the file if it cannot be read."""
        ...

    def __iter__(self) -> Iterator[Frame]:
        """Read the frames in order."""
        ...
