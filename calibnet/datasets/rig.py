"""A camera among several on one rig."""

from __future__ import annotations

from dataclasses import dataclass, field

from calibnet.datasets.frame import Frames
from calibnet.geometry.types import Transform


@dataclass(frozen=True, eq=False)
class RigCamera:
    """A camera of a rig, and its frames with the LiDAR.

    Attributes:
        name: for messages.
        frames: of this camera.
        camera_from_rig: 4x4, where the rig is.
    """

    name: str
    frames: Frames
    camera_from_rig: Transform = field(repr=False)
