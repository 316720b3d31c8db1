"""The interface of datasets: a `Sequence` that yields each `Frame`."""

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
    """An image as taken, ``[H, W, 3]`` uint8 RGB, and its camera, lens included."""

    image: NDArray[np.uint8]
    camera: CameraModel


class Face(NamedTuple):
    """The image ``[H, W, 3]`` uint8 RGB of a pinhole camera in the place of a wide lens, and its rotation."""

    image: NDArray[np.uint8]
    camera: PinholeCamera
    face_from_camera: Rotation


@dataclass(frozen=True, eq=False)
class Frame:
    """One synchronised image and scan.

    Attributes:
        index: number of the frame, as in its files.
        timestamp: seconds since the sequence's first frame.
        image: ``[H, W, 3]`` uint8, RGB, rectified.
        points: ``[N, 4]`` float32, finite: x forward, y left, z up in metres, intensity 0..1.
        camera: intrinsics of ``image``.
        camera_from_lidar: the dataset's own extrinsic, 4x4 float64; the reference where the
            dataset is calibrated, a starting guess where the user's sensors are not yet.
        source: the image's path or a description, for messages.
        remarks: unlikely findings, which are the first suspects if it does not fit.
        original: the image before rectification; None if it was rectified already.
        faces: faces of a lens that is wider than a pinhole, used for calibration instead of ``image``, which is its
            middle.
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
        """One of its faces as a frame of its own."""
        turned = transform(face.face_from_camera, (0.0, 0.0, 0.0)) @ self.camera_from_lidar
        image, camera = face.image, face.camera
        return replace(self, image=image, camera=camera, camera_from_lidar=turned, original=None, faces=())

    def changed(self, change: Callable[[Frame], Frame]) -> Frame:
        """Apply a change to the frame and to the image of each face."""
        faces = [(face, change(self.through(face))) for face in self.faces]
        return replace(
            change(self), faces=tuple(face._replace(image=new.image, camera=new.camera) for face, new in faces)
        )

    @property
    def as_taken(self) -> Original:
        """The original image and camera, which are shown, recorded and exported."""
        return self.original or Original(self.image, CameraModel.of(self.camera))


class Frames(Protocol):
    """Frames of a drive: a `Sequence`, or a list of frames."""

    def __len__(self) -> int:
        """Number of frames."""
        ...

    def __getitem__(self, position: int, /) -> Frame:
        """Read one frame."""
        ...


@runtime_checkable
class Numbered(Protocol):
    """Frames whose numbers are known before they are read."""

    def index_of(self, position: int, /) -> int:
        """`Frame.index` of the frame at a position."""
        ...


def index_of(frames: Frames, position: int) -> int:
    """The number of a frame that may be unreadable: `Frame.index`, or its position if the frames are not `Numbered`."""
    return frames.index_of(position) if isinstance(frames, Numbered) else position


@runtime_checkable
class Sequence(Protocol):
    """Frames of one camera and one LiDAR on one mount, read lazily.

    If frames are not numbered by their positions, it is `Numbered` too, so that an unreadable frame has its right
    number in messages.

    Attributes:
        name: name for titles and file names, for instance ``"kitti-odometry/04"``.
        rig: sensors and mount of the frames, for instance ``"KITTI 2011_09_30, camera 2"``.
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
