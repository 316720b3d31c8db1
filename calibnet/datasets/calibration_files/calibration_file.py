"""What a calibration file says, whichever tool wrote it, and what is asked of one that says it of several sensors."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from calibnet.datasets.images.files import read_image
from calibnet.errors import DatasetError
from calibnet.geometry.camera_model import CameraModel
from calibnet.geometry.types import Extrinsic, Transform


class FrameChoice(NamedTuple):
    """Names of coordinate frames, for files that hold many; None to find them by their names."""

    camera: str | None = None
    lidar: str | None = None


BY_NAME = FrameChoice()
"""Frames are found by what they are called."""


@dataclass(frozen=True)
class Wanted:
    """What to take from a file that holds more than one of a kind.

    Attributes:
        camera: its name in the file; None where the file holds only one.
        frames: of the coordinate frames.
        picture: one of the camera's, or its width and height, for formats that do not say its size.
    """

    camera: str | None = None
    frames: FrameChoice = BY_NAME
    picture: Path | tuple[int, int] | None = None

    @property
    def size(self) -> tuple[int, int] | None:
        """Width and height of the picture; None where it cannot be read."""
        if isinstance(self.picture, tuple):
            return self.picture
        try:
            height, width = read_image(self.picture).shape[:2] if self.picture is not None else (0, 0)
        except DatasetError:
            return None
        return (width, height) if width else None


@dataclass(frozen=True, eq=False)
class CalibrationFile:
    """The content of a calibration file.

    Attributes:
        kind: what wrote it, for sentences, for instance ``"Kalibr's camchain"``.
        camera: None where the file tells only where the sensors are.
        camera_from_lidar: 4x4; None where the file knows no LiDAR.
        rig_from_camera: 4x4, where the camera sits on a rig of several; None where it does not say.
        cloud_columns: names of the columns of ``.bin`` and text clouds; None where it does not say.
        bayer: pattern of a sensor whose pictures are not demosaiced, of `calibnet.datasets.images.development.BAYER`.
        prior: what is fixed or known beforehand of the extrinsic, as the options of the same names say it.
    """

    kind: str
    camera: CameraModel | None = None
    camera_from_lidar: Extrinsic | None = field(default=None, repr=False)
    rig_from_camera: Transform | None = field(default=None, repr=False)
    cloud_columns: tuple[str, ...] | None = None
    prior: dict[str, str] = field(default_factory=dict)
    bayer: str | None = None
