"""The content of a calibration file of any tool, and the selection from a file of several sensors."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from calibnet.datasets.images.files import read_image
from calibnet.errors import DatasetError
from calibnet.geometry.camera_model import CameraModel
from calibnet.geometry.types import Extrinsic, Transform


class FrameChoice(NamedTuple):
    """Names of the coordinate frames to use; None to recognise them by their names."""

    camera: str | None = None
    lidar: str | None = None


BY_NAME = FrameChoice()
"""Recognise both frames by their names."""


@dataclass(frozen=True)
class Wanted:
    """Selection from a file with several sensors.

    Attributes:
        camera: name of the camera in the file; None if it has only one.
        frames: names of the coordinate frames.
        image: an image of the camera, or its width and height, for formats that do not contain the size.
    """

    camera: str | None = None
    frames: FrameChoice = BY_NAME
    image: Path | tuple[int, int] | None = None

    @property
    def size(self) -> tuple[int, int] | None:
        """Width and height of the image; None if it cannot be read."""
        if isinstance(self.image, tuple):
            return self.image
        try:
            height, width = read_image(self.image).shape[:2] if self.image is not None else (0, 0)
        except DatasetError:
            return None
        return (width, height) if width else None


@dataclass(frozen=True, eq=False)
class CalibrationFile:
    """The content of a calibration file.

    Attributes:
        kind: kind of file for messages, for instance ``"Kalibr's camchain"``.
        camera: the camera; None if the file has only poses.
        camera_from_lidar: the extrinsic, 4x4; None if the file has no LiDAR.
        rig_from_camera: pose of the camera on its rig, 4x4; None if not given.
        cloud_columns: names of the columns of ``.bin`` and text clouds; None where it does not say.
        bayer: pattern of a sensor whose images are not demosaiced, from `calibnet.datasets.images.development.BAYER`.
        prior: prior on the extrinsic, with the names and values of the command line's options.
    """

    kind: str
    camera: CameraModel | None = None
    camera_from_lidar: Extrinsic | None = field(default=None, repr=False)
    rig_from_camera: Transform | None = field(default=None, repr=False)
    cloud_columns: tuple[str, ...] | None = None
    prior: dict[str, str] = field(default_factory=dict)
    bayer: str | None = None
