"""The interface of the cascade (`calibnet.cascade`) and of every other method (`calibnet.methods`).

`Calibrator` corrects the extrinsic of one frame, `DriveCalibrator` also that of a whole drive, and `Explainer` also
finds the causes of a bad frame.
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
            frame: image, scan and camera; its own extrinsic must not be used.
            initial: ``camera_from_lidar`` to start from, 4x4.
            detail: whether to keep intermediate results in each `StageTrace.detail`, if the method has any.

        Returns:
            The trace, stage by stage; a method without stages has one stage.

        Raises:
            CalibrationError: the frame cannot be calibrated.
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
            frames: at least one frame of one camera and LiDAR on one mount.
            initial: ``camera_from_lidar`` to start from, 4x4.
            observer: called before each frame, and optionally at the end, with the number of frames read and the total;
                a frame may be read more than once.

        Raises:
            CalibrationError: no frame could be calibrated.
        """
        ...


def drives_only(calibrator: object) -> bool:
    """Whether a method calibrates only whole drives, which it declares by an attribute ``drives_only``."""
    return isinstance(calibrator, DriveCalibrator) and bool(getattr(calibrator, "drives_only", False))


@runtime_checkable
class Explainer(Protocol):
    """A method that can also find out what is wrong with a frame, at many times the cost of calibrating it."""

    def explain(self, frame: Frame, initial: Extrinsic, lags: Search | None = None) -> Verdict:
        """The verdict on a frame, with causes.

        Args:
            frame: image, scan and camera; its own extrinsic must not be used.
            initial: ``camera_from_lidar`` to start from, 4x4.
            lags: search for a lag of the scan, if the neighbouring frames are known.
        """
        ...


def with_causes(
    calibrator: Calibrator,
    frame: Frame,
    initial: Extrinsic,
    verdict: Verdict,
    lags: Callable[[], Search | None] = lambda: None,
) -> Verdict:
    """The verdict on a frame, to which causes are added if it is not accepted, has none, and the method can find them.

    Args:
        calibrator: method that gave the verdict.
        frame: image, scan and camera.
        initial: initial ``camera_from_lidar`` of the method.
        verdict: verdict without causes.
        lags: makes the search for a lag of the scan, called only if causes are searched.
    """
    if verdict.word == ACCEPTED or verdict.causes or not isinstance(calibrator, Explainer):
        return verdict
    return calibrator.explain(frame, initial, lags())
