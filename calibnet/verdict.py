"""The verdict on a calibration: accepted, rejected or cannot tell, with the reason."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, Literal, NamedTuple

import numpy as np

from calibnet.geometry import PoseError, pose_error, transform
from calibnet.geometry.se3 import rotated
from calibnet.geometry.types import Extrinsic, Matrix6, Rotation

Word = Literal["accepted", "rejected", "cannot tell"]
ACCEPTED: Word = "accepted"
REJECTED: Word = "rejected"
CANNOT_TELL: Word = "cannot tell"
WORDS: tuple[Word, ...] = (ACCEPTED, REJECTED, CANNOT_TELL)
APART: Literal["apart"] = "apart"
"""Word for a drive whose result differs from that of its car's other drives."""

CAUSES = (
    "focal-length",
    "principal-point",
    "distortion",
    "lens-model",
    "roll",
    "mirrored",
    "other-picture",
    "time-offset",
    "accumulated",
    "units",
    "axes",
    "left-handed",
    "bit-depth",
    "picture-size",
)
"""Names of possible causes in the input, as in JSON; scripts compare them, so they keep the word "picture" for an
image."""


class Tolerance(NamedTuple):
    """The largest error of a good extrinsic."""

    rotation_deg: float
    translation_cm: float

    def holds(self, error: PoseError) -> bool:
        """Whether an error is within it."""
        return error.rotation_deg <= self.rotation_deg and error.translation_cm <= self.translation_cm

    def __str__(self) -> str:
        return f"{self.rotation_deg:g}° / {self.translation_cm:g} cm"


FRAME_TOLERANCES = (Tolerance(1.0, 25.0), Tolerance(1.5, 40.0))
DRIVE_TOLERANCES = (Tolerance(0.3, 8.0), Tolerance(0.5, 15.0))
"""What the extrinsic of a frame, and of a drive, must be within to be accepted; and a coarser tolerance, of which a
result can often be certain where it cannot be of the first."""
FRAME_LIMITS, DRIVE_LIMITS = FRAME_TOLERANCES[0], DRIVE_TOLERANCES[0]
"""Beyond these the extrinsic of a frame, and of a drive, is wrong."""


@dataclass(frozen=True)
class Cause:
    """A likely cause in the input.

    Attributes:
        name: one of `CAUSES`.
        text: a sentence for the user.
        evidence: the measurement that supports it.
    """

    name: str
    text: str
    evidence: str

    def as_dict(self) -> dict[str, str]:
        """The JSON object."""
        return {"name": self.name, "text": self.text, "evidence": self.evidence}


@dataclass(frozen=True)
class BadFrame:
    """A frame that could not be used.

    Attributes:
        frame: number of the frame, `calibnet.datasets.frame.Frame.index`.
        why: the reason, in one sentence.
    """

    frame: int
    why: str


@dataclass(frozen=True, eq=False)
class Verdict:
    """The verdict on a calibration.

    Attributes:
        word: accepted, rejected or cannot tell.
        reason: the reason, a sentence for the user.
        camera_from_lidar: the judged extrinsic, 4x4.
        moved: rotation in degrees and translation in centimetres from the initial extrinsic to it.
        causes: likely causes in the input, the likeliest first.
        covariance: ``[6, 6]`` of ``(translation m, rotation rad)``; None if unknown.
        used: number of frames judged.
        skipped: frames that were left out.
        within: the finest tolerance that the extrinsic is certain enough to be within; None if there is none. That of
            an accepted one is the first of `FRAME_TOLERANCES` or `DRIVE_TOLERANCES`.
        advice: what to do next, a sentence; empty where the reason or the causes say it, or if there is nothing to do.
    """

    word: Word
    reason: str
    camera_from_lidar: Extrinsic = field(repr=False)
    moved: tuple[float, float] = (0.0, 0.0)
    causes: tuple[Cause, ...] = ()
    covariance: Matrix6 | None = field(default=None, repr=False)
    used: int = 1
    skipped: tuple[BadFrame, ...] = ()
    within: Tolerance | None = None
    advice: str = ""

    def rotated(self, rotation: Rotation) -> Verdict:
        """The verdict for a camera turned by ``rotation [3, 3]``."""
        extrinsic = transform(rotation, np.zeros(3)) @ self.camera_from_lidar
        return replace(self, camera_from_lidar=extrinsic, covariance=rotated(self.covariance, rotation))

    @property
    def sigma_rotation_deg(self) -> float | None:
        """Standard deviation of the rotation over all axes."""
        return None if self.covariance is None else float(np.degrees(np.sqrt(np.trace(self.covariance[3:, 3:]))))

    @property
    def sigma_translation_cm(self) -> float | None:
        """Standard deviation of the translation over all axes."""
        return None if self.covariance is None else float(100 * np.sqrt(np.trace(self.covariance[:3, :3])))

    def as_dict(self) -> dict[str, Any]:
        """The JSON object, the same in all files."""
        sigma = None
        if self.covariance is not None:
            sigma = {
                "rotation_deg": self.sigma_rotation_deg,
                "translation_cm": self.sigma_translation_cm,
                "covariance": self.covariance.tolist(),
            }
        return {
            "verdict": self.word,
            "reason": self.reason,
            "causes": [cause.as_dict() for cause in self.causes],
            "advice": self.advice,
            "camera_from_lidar": self.camera_from_lidar.tolist(),
            "moved": {"rotation_deg": self.moved[0], "translation_cm": self.moved[1]},
            "sigma": sigma,
            "within": None if self.within is None else self.within._asdict(),
            "frames": {"used": self.used, "skipped": [vars(skipped) for skipped in self.skipped]},
        }


def with_its_car(alone: str, by_car: str) -> str:
    """The word for a drive: its own, or that of all drives of its car where that is more certain or worse.

    Args:
        alone: of the drive by itself.
        by_car: of all drives of its car together, `APART`, or empty where they say nothing.
    """
    heard: dict[str, tuple[str, ...]] = {CANNOT_TELL: (ACCEPTED, REJECTED, APART), ACCEPTED: (REJECTED, APART)}
    return by_car if by_car in heard.get(alone, ()) else alone


def moved(initial: Extrinsic, final: Extrinsic) -> tuple[float, float]:
    """Rotation in degrees and translation in centimetres, as `calibnet.geometry.pose_error` measures them."""
    error = pose_error(final, initial)
    return error.rotation_deg, error.translation_cm
