"""A cascade that finds the reference in every drive, and says of it what a test wants."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from calibnet.errors import DatasetError
from calibnet.trace import DriveEstimate, Estimate
from calibnet.verdict import Cause, Verdict
from tests.support.fakes import REFERENCE, FakeCascade

COVARIANCE = np.diag([*[0.01**2] * 3, *[np.radians(0.05) ** 2] * 3])
"""1 cm and 0.05° on every axis."""


class JudgedCascade(FakeCascade):
    """Counts the drives that it solves."""

    word = "accepted"
    causes: tuple[Cause, ...] = ()
    solved = 0

    def calibrate(self, frame: Any, initial: Any, detail: bool = True) -> Any:
        return replace(super().calibrate(frame, initial, detail), verdict=self.verdict(1))

    def calibrate_drive(self, frames: Any, initial: Any, observer: Any = None) -> DriveEstimate:
        self.solved += 1
        for position in range(len(frames)):
            try:
                _ = frames[position]
            except DatasetError:
                continue
        history = ((0, Estimate(REFERENCE, COVARIANCE, len(frames))),)
        return DriveEstimate(REFERENCE, COVARIANCE, len(frames), history, verdict=self.verdict(len(frames)))

    def explain(self, frame: Any, initial: Any, lags: Any = None) -> Verdict:
        return self.verdict(1)

    def verdict(self, frames: int) -> Verdict:
        return Verdict(self.word, "Who knows.", REFERENCE, (0.0, 0.0), self.causes, COVARIANCE, frames)  # type: ignore[arg-type]
