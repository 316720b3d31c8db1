"""A classical refinement without training, to compare the networks with: `calibnet.alignment` on single frames.

It starts from the same guesses as the networks, most of which are farther off than edges can correct.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import torch

from calibnet.alignment import align, gather, image_camera
from calibnet.alignment.evidence import image_edges
from calibnet.datasets.frame import Frame
from calibnet.datasets.images.files import resize_image
from calibnet.exhibit import Exhibit
from calibnet.geometry import MiscalibrationRange
from calibnet.geometry.se3 import pose_from_vector
from calibnet.geometry.types import Extrinsic
from calibnet.runtime.clock import Clock
from calibnet.trace import CascadeTrace, StageTrace


class EdgeAlignment:
    """A `Calibrator` without weights."""

    def __init__(self, range_: MiscalibrationRange) -> None:
        """Expect miscalibrations within ``range_``, which is the prior of the correction."""
        self.range = range_
        self.covariance = np.diag(1 / np.diag(range_.information))

    def calibrate(self, frame: Frame, initial: Extrinsic, detail: bool = False) -> CascadeTrace:
        """Refine ``initial`` on one frame; it stays as it is if the frame has no evidence."""
        clock = Clock(torch.device("cpu"))
        evidence = gather(frame, initial)
        clock("evidence")
        found, _ = align([evidence], np.zeros(6), self.covariance)
        clock("alignment")
        change, camera = pose_from_vector(found), image_camera(frame.camera)
        stage = StageTrace(1, self.range, camera, initial, change @ initial, change, clock.parts)
        return CascadeTrace(initial, (replace(stage, exhibits=exhibits(frame)) if detail else stage,))


def exhibits(frame: Frame) -> tuple[Exhibit, ...]:
    """The edges of the image that edges of the scan are aligned to."""
    camera = image_camera(frame.camera)
    grey = np.asarray(cv2.cvtColor(resize_image(frame.image, camera), cv2.COLOR_RGB2GRAY), np.uint8)
    across, any_way = image_edges(grey, camera)
    return (
        Exhibit("Edges across the rows, to which depth edges are aligned", across.image),
        Exhibit("All edges, to which those of reflectance are aligned", any_way.image),
    )
