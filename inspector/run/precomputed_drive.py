"""Shows the result of a method that solves whole drives only, on each of its frames."""

from __future__ import annotations

from collections.abc import Callable

from calibnet.datasets.frame import Frame, Frames
from calibnet.errors import DatasetError
from calibnet.geometry.types import Extrinsic
from calibnet.trace import CascadeTrace, DriveEstimate


class PrecomputedDrive:
    """A `calibnet.calibrator.DriveCalibrator` that returns an estimate made before."""

    def __init__(self, estimate: DriveEstimate) -> None:
        """Answer with ``estimate``, which has traces."""
        self.estimate = estimate

    def calibrate(self, frame: Frame, initial: Extrinsic, detail: bool = False) -> CascadeTrace:
        """The drive's result on one of its frames, including those that the method left out."""
        found = self.estimate.traces
        return found.get(frame.index) or next(iter(found.values()))

    def calibrate_drive(
        self, frames: Frames, initial: Extrinsic, observer: Callable[[int, int], None] | None = None
    ) -> DriveEstimate:
        """The estimate."""
        return self.estimate


def first_readable(frames: Frames) -> Frame:
    """The first frame that can be read.

    Raises:
        DatasetError: none can; the error is that of the first.
    """
    failure: DatasetError | None = None
    for position in range(len(frames)):
        try:
            return frames[position]
        except DatasetError as error:
            failure = failure or error
    raise failure or DatasetError("There are no frames to read.")
