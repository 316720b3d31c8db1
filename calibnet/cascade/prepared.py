"""Prepares frames like those that the networks were trained on, with a single scan and an upright image."""

from __future__ import annotations

from dataclasses import dataclass, replace

from calibnet.cascade.upright import Upright
from calibnet.datasets.clouds.plausibility import several
from calibnet.datasets.frame import Frame, Frames, index_of
from calibnet.geometry.visibility import as_one_scan


def prepared(frame: Frame, upright: Upright) -> Frame:
    """The frame turned upright and with its cloud reduced to one scan, as far as needed."""
    if remark := several(frame.points):
        known = any(other.name == remark.name for other in frame.remarks)  # whoever read the frame has reported it
        remarks = frame.remarks if known else (*frame.remarks, remark)
        frame = replace(frame, points=as_one_scan(frame.points), remarks=remarks)
    return upright.frame(frame)


@dataclass(frozen=True)
class PreparedFrames:
    """The frames of a drive, each prepared when it is read."""

    frames: Frames
    upright: Upright

    def __len__(self) -> int:
        return len(self.frames)

    def index_of(self, position: int) -> int:
        """The number of a frame."""
        return index_of(self.frames, position)

    def __getitem__(self, position: int, /) -> Frame:
        """Read one frame."""
        return prepared(self.frames[position], self.upright)
