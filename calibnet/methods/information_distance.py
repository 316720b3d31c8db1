"""Information distance of reflectance and brightness, after Koide et al., "General, single-shot, target-less" (2023).

Reflectance and brightness depend on each other most where scan and image fit. Their normalised information distance is
minimised from several starts around the guess, and the best result is taken. The paper gets its guess from matched
features, close enough for a single descent; here the guess is given and farther off, so the several starts are ours.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch

from calibnet.alignment import Evidence, align, gather, image_camera
from calibnet.alignment.evidence import Reflectance
from calibnet.datasets.frame import Frame
from calibnet.errors import CalibrationError
from calibnet.exhibit import Curve, Exhibit
from calibnet.geometry import MiscalibrationRange
from calibnet.geometry.se3 import pose_from_vector
from calibnet.geometry.types import Extrinsic
from calibnet.runtime.clock import Clock
from calibnet.trace import CascadeTrace, StageTrace

STARTS = 20
"""Number of starts: the guess, and random poses around it."""
SEED = 0


class InformationDistance:
    """A `Calibrator` without weights."""

    def __init__(self, range_: MiscalibrationRange) -> None:
        """Expect miscalibrations within ``range_``."""
        self.range = range_
        self.covariance = np.diag(1 / np.diag(range_.information))

    def calibrate(self, frame: Frame, initial: Extrinsic, detail: bool = False) -> CascadeTrace:
        """Minimise the distance from all starts.

        Raises:
            CalibrationError: the scan has no reflectance, or too few of its points are in the image.
        """
        clock = Clock(torch.device("cpu"))
        terms = [term for term in gather(frame, initial).terms if isinstance(term, Reflectance)]
        if not terms:
            raise CalibrationError(f"Frame {frame.index} has too few points with reflectance inside the image.")
        evidence = Evidence(tuple(terms))
        clock("histogram")
        generator = np.random.default_rng(SEED)
        spread = np.linalg.cholesky(self.covariance)
        starts = [np.zeros(6), *(generator.normal(size=(STARTS - 1, 6)) @ spread.T)]
        found = [align([evidence], np.zeros(6), self.covariance, [start])[0] for start in starts]
        distances = np.array([evidence(pose_from_vector(vector))[0] for vector in found])
        clock("descent")
        change, camera = pose_from_vector(found[int(distances.argmin())]), image_camera(frame.camera)
        stage = StageTrace(1, self.range, camera, initial, change @ initial, change, clock.parts)
        if detail:
            brightness = Exhibit("Brightness compared with the scan's reflectance", terms[0].brightness.image)
            curve = Curve("Final distance of each start above the best, sorted", np.sort(distances) - distances.min())
            stage = replace(stage, exhibits=(brightness,), curves=(curve,))
        return CascadeTrace(initial, (stage,))
