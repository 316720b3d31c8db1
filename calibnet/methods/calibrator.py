"""The interface of a method: `Calibrator` on one frame, `DriveCalibrator` on a drive, `Explainer` of what is wrong.

A method may say what it costs (`Described`), and that it needs the motion of a drive (`drives_only`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

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


_RENAMED = {"kitti-object/train": "KITTI object detection"}
"""Rigs that records of packed trainings once named after their sequence."""


@dataclass(frozen=True)
class MethodCard:
    """What a method costs and what it was trained on, for tables.

    Attributes:
        parameters: of its networks, of all stages that run; 0 without networks.
        multiply_adds: of its networks for one frame, likewise.
        samples_trained: that its networks have seen, all stages together.
        trained_on: the rigs of these, as `Sequence.rig` begins, for instance ``("KITTI 2011_09_26",)``.
    """

    parameters: int = 0
    multiply_adds: int = 0
    samples_trained: int = 0
    trained_on: tuple[str, ...] = ()

    @classmethod
    def trained(cls, parameters: int, multiply_adds: int, records: Iterable[Mapping[str, Any]]) -> MethodCard:
        """Of networks that cost so much together, with the records of their trainings (`read_record`)."""
        records = list(records)
        rigs = (_RENAMED.get(rig, rig) for record in records for rig in record.get("rigs", ()))
        samples = sum(int(record.get("samples", 0)) for record in records)
        return cls(parameters, multiply_adds, samples, tuple(dict.fromkeys(rigs)))

    def knows(self, rig: str) -> bool:
        """Whether it was trained on a rig."""
        return any(rig.startswith(one) for one in self.trained_on)


@runtime_checkable
class Described(Protocol):
    """A method that says what it costs; one that does not is taken to have no networks."""

    @property
    def card(self) -> MethodCard:
        """Its costs."""
        ...


def card_of(calibrator: object) -> MethodCard:
    """What a method costs."""
    return calibrator.card if isinstance(calibrator, Described) else MethodCard()


def drives_only(calibrator: object) -> bool:
    """Whether a method tells something of whole drives alone: it says so by an attribute ``drives_only``."""
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
