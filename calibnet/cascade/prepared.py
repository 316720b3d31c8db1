"""Frames as networks have learnt to see them: with one scan, and a picture that stands upright."""

from __future__ import annotations

from dataclasses import dataclass, replace

from calibnet.cascade.upright import Upright
from calibnet.datasets.frame import Frame, Frames
from calibnet.datasets.plausibility import several
from calibnet.geometry.visibility import as_one_scan


def prepared(frame: Frame, upright: Upright) -> Frame:
    """The frame, turned as `upright` says, and of a cloud of several scans what one would have; else the very same."""
    if remark := several(frame.points):
        known = any(other.name == remark.name for other in frame.remarks)  # to whoever read the frame
        remarks = frame.remarks if known else (*frame.remarks, remark)
        frame = replace(frame, points=as_one_scan(frame.points), remarks=remarks)
    return upright.frame(frame)


@dataclass(frozen=True)
class PreparedFrames:
    """The frames of a drive, each prepared as it is read."""

    frames: Frames
    upright: Upright

    def __len__(self) -> int:
        return len(self.frames)

    def __getitem__(self, position: int, /) -> Frame:
        """Read one frame."""
        return prepared(self.frames[position], self.upright)
