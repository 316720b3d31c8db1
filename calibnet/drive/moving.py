"""The pairs of successive frames of a drive whose motion is used."""

from __future__ import annotations

from calibnet.datasets.frame import Frame
from calibnet.datasets.selection import evenly_spaced
from calibnet.drive.convergence import Due
from calibnet.geometry.types import Extrinsic
from calibnet.motion import MotionPairs, motion_estimate
from calibnet.trace import MotionEstimate

PAIRS = 12
"""Number of pairs of successive frames, spread over the drive; each takes 1 MB until the end."""


class Moving:
    """Picks pairs of successive frames, spread over a drive, as the drive goes on."""

    def __init__(self, extrinsic: Extrinsic, frames: int) -> None:
        """Expect motion in the images under ``extrinsic``."""
        self._pairs, self._due = MotionPairs(extrinsic), Due(evenly_spaced(frames - 1, PAIRS) if frames > 1 else [])
        self._last: tuple[int, Frame] | None = None

    def note(self, position: int, frame: Frame) -> None:
        """Note the next frame of the drive."""
        if self._last is not None and self._last[0] == position - 1 and self._due.reached(position - 1):
            self._pairs.add(self._last[1], frame)
        self._last = position, frame

    def estimate(self, extrinsic: Extrinsic) -> MotionEstimate | None:
        """The extrinsic near another one that explains the motion; None if it shows too little."""
        return motion_estimate(self._pairs, extrinsic)
