"""A classical refinement without training, to hold the networks against: `calibnet.alignment` on single frames.

It starts where networks would, which is mostly farther than edges pull: that is what networks are for.
"""

from __future__ import annotations

import numpy as np

from calibnet.alignment import align, gather, picture_camera
from calibnet.datasets.frame import Frame
from calibnet.geometry import MiscalibrationRange
from calibnet.geometry.se3 import pose_from_vector
from calibnet.geometry.types import Extrinsic
from calibnet.trace import CascadeTrace, StageTrace


class EdgeAlignment:
    """A `Calibrator` without weights."""

    def __init__(self, range_: MiscalibrationRange) -> None:
        """Expect miscalibrations within ``range_``; farther ones are held back by it."""
        self.range = range_
        self.covariance = np.diag(1 / np.diag(range_.information))

    def calibrate(self, frame: Frame, initial: Extrinsic, detail: bool = False) -> CascadeTrace:
        """Refine ``initial`` on one frame; it stays as it is where nothing in the frame tells."""
        found, _ = align([gather(frame, initial)], np.zeros(6), self.covariance)
        change, camera = pose_from_vector(found), picture_camera(frame.camera)
        return CascadeTrace(initial, (StageTrace(1, self.range, camera, initial, change @ initial, change),))
