"""What the cascade (`calibnet.cascade`) and every other method (`calibnet.methods`) can be asked to do.

`Calibrator` corrects the extrinsic of one frame, `DriveCalibrator` also that of a whole drive, and `Explainer` also
names what is wrong with a frame.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol, runtime_checkable

from calibnet.datasets.frame import Frame, Frames
from calibnet.geometry.types import Extrinsic
from calibnet.trace import CascadeTrace, DriveEstimate
from calibnet.verdict import ACCEPTED, Verdict

if TYPE_CHECKING:
    from calibnet.judging.causes import Search  # loads OpenCV


@runtime_checkable
class Calibrator(Protocol):
    """Corrects the extrinsic of one frame; `calibnet.cascade.cascade.Cascade` is one."""

    def calibrate(self, frame: Frame, initial: Extrinsic, detail: bool = False) -> CascadeTrace:
        """Correct ``initial``.

        Args:
            frame: image, scan and camera; its own extrinsic must not be looked at.
            initial: ``camera_from_lidar`` to start from, 4x4.
            detail: keep intermediate results in each `StageTrace.detail`, where the method has any to show.

        Returns:
            What happened stage by stage; a method without stages has one.

        Raises:
            CalibrationError: this frame cannot be calibrated.
        """
        ...


@runtime_checkable
class DriveCalibrator(Calibrator, Protocol):
    """Also solves the one extrinsic of a drive from all its frames."""

    def calibrate_drive(
        self, frames: Frames, initial: Extrinsic, observer: Callable[[int, int], None] | None = None
    ) -> DriveEstimate:
        """Correct ``initial``.

        Args:
            frames: of one camera and LiDAR on one mount, at least one.
            initial: ``camera_from_lidar`` to start from, 4x4.
            observer: called before each frame, and at the end if it likes, with the numbers of frames read and to be
                read; a frame may be read more than once.

        Raises:
            CalibrationError: no frame could be calibrated.
        """
        ...


def drives_only(calibrator: object) -> bool:
    """Whether a method calibrates whole drives only, not single frames: it says so by an attribute ``drives_only``."""
    return isinstance(calibrator, DriveCalibrator) and bool(getattr(calibrator, "drives_only", False))


@runtime_checkable
class Explainer(Protocol):
    """A method that can also find out what is wrong with a frame, at many times the price of calibrating it."""

    def explain(self, frame: Frame, initial: Extrinsic, lags: Search | None = None) -> Verdict:
        """The verdict on a frame, with the causes of what does not fit.

        Args:
            frame: image, scan and camera; its own extrinsic must not be looked at.
            initial: ``camera_from_lidar`` to start from, 4x4.
            lags: of the scan, that are to be tried as well, where the frames beside it are known.
        """
        ...


def with_causes(
    calibrator: Calibrator,
    frame: Frame,
    initial: Extrinsic,
    verdict: Verdict,
    lags: Callable[[], Search | None] = lambda: None,
) -> Verdict:
    """The verdict on a frame with causes, where it is not accepted, names none yet, and the method can find them.

    Args:
        calibrator: that gave the verdict.
        frame: image, scan and camera.
        initial: ``camera_from_lidar`` that it started from.
        verdict: without causes.
        lags: of the scan, worked out only where causes are looked for.
    """
    if verdict.word == ACCEPTED or verdict.causes or not isinstance(calibrator, Explainer):
        return verdict
    return calibrator.explain(frame, initial, lags())
