"""Wraps another method so that its traces have its name, and none of its results is accepted.

A verdict is fitted to the errors of one method, so far only to those of the cascade. So whatever another method says of
its result, the verdict is *cannot tell*; only its own rejections are kept.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from calibnet.calibrator import Calibrator, DriveCalibrator, drives_only
from calibnet.datasets.frame import Frame, Frames
from calibnet.geometry.types import Extrinsic
from calibnet.methods.card import MethodCard, card_of
from calibnet.trace import CascadeTrace, DriveEstimate
from calibnet.verdict import CANNOT_TELL, REJECTED, Verdict, moved


def unjudged(name: str, calibrator: Calibrator) -> Calibrator:
    """The same method with its name in every trace, and with the verdict *cannot tell* on its results."""
    return UnjudgedDrive(name, calibrator) if isinstance(calibrator, DriveCalibrator) else Unjudged(name, calibrator)


class Unjudged:
    """A method for single frames, see `unjudged`."""

    def __init__(self, name: str, calibrator: Calibrator) -> None:
        """Wrap ``calibrator`` under a ``name``."""
        self.name, self.calibrator = name, calibrator

    @property
    def card(self) -> MethodCard:
        """The card of the method itself."""
        return card_of(self.calibrator)

    def calibrate(self, frame: Frame, initial: Extrinsic, detail: bool = False) -> CascadeTrace:
        """Calibrate as the method does, and put the verdict *cannot tell* on it unless it is rejected."""
        trace = self.calibrator.calibrate(frame, initial, detail)
        return replace(trace, method=self.name, verdict=self._verdict(initial, trace.arrived, trace.verdict))

    def _verdict(self, initial: Extrinsic, found: Extrinsic, own: Verdict | None) -> Verdict:
        if own is not None and own.word == REJECTED:
            return own
        reason = f"Results of {self.name} are not judged; only results of the cascade can be accepted."
        if own is not None and own.word == CANNOT_TELL:
            reason = f"{reason} {own.reason}"
        stated = None if own is None else own.covariance
        return Verdict(CANNOT_TELL, reason, found, moved(initial, found), covariance=stated)


class UnjudgedDrive(Unjudged):
    """A method that also solves drives."""

    calibrator: DriveCalibrator

    @property
    def drives_only(self) -> bool:
        """Whether the method calibrates whole drives only."""
        return drives_only(self.calibrator)

    def calibrate_drive(
        self, frames: Frames, initial: Extrinsic, observer: Callable[[int, int], None] | None = None
    ) -> DriveEstimate:
        """Calibrate as the method does, and put the verdict *cannot tell* on it unless it is rejected."""
        estimate = self.calibrator.calibrate_drive(frames, initial, observer)
        verdict = self._verdict(initial, estimate.camera_from_lidar, estimate.verdict)
        used = replace(verdict, covariance=estimate.covariance, used=estimate.frames, skipped=estimate.skipped)
        traces = {
            frame: replace(trace, method=self.name, verdict=self._verdict(initial, trace.arrived, trace.verdict))
            for frame, trace in estimate.traces.items()
        }
        return replace(estimate, verdict=used, traces=traces)
