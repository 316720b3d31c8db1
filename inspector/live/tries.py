"""One try: its extrinsics from the pose to the result, and the verdict on the result."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from calibnet.geometry import pose_error
from calibnet.geometry.types import Extrinsic
from calibnet.trace import CascadeTrace, DriveEstimate
from calibnet.verdict import Verdict
from inspector.verdicts import explained


@dataclass(frozen=True, eq=False)
class Step:
    """An intermediate extrinsic and its name, for instance ``mine``, ``stage 3`` or ``drive``."""

    name: str
    camera_from_lidar: Extrinsic = field(repr=False)


@dataclass(frozen=True, eq=False)
class Try:
    """The result from one pose.

    Attributes:
        number: number from 0, its place on the timeline ``try``.
        frame: number of the frame.
        title: name of what ran.
        steps: extrinsics from the pose to the result.
        verdict: verdict on the result.
        milliseconds: computing time.
        trace: trace of the cascade, where it ran on one frame.
    """

    number: int
    frame: int
    title: str
    steps: tuple[Step, ...]
    verdict: Verdict | None
    milliseconds: float
    trace: CascadeTrace | None = field(default=None, repr=False)

    @property
    def found(self) -> Extrinsic:
        """The resulting ``camera_from_lidar``, accepted or not."""
        return self.steps[-1].camera_from_lidar

    @classmethod
    def of_trace(cls, number: int, frame: int, trace: CascadeTrace, milliseconds: float) -> Try:
        """The try of a run of stages on one frame."""
        steps = [Step("mine", trace.initial)]
        steps += [Step(f"stage {stage.number}", stage.after) for stage in trace.stages]
        ran = [stage.number for stage in trace.stages]
        title = f"stage {ran[0]}" if len(ran) == 1 else f"stages {ran[0]} to {ran[-1]}" if ran else "no stage"
        return cls(number, frame, title, tuple(steps), trace.verdict, milliseconds, trace)

    @classmethod
    def of_drive(cls, number: int, frame: int, mine: Extrinsic, estimate: DriveEstimate, milliseconds: float) -> Try:
        """The try of a drive, with all frames solved as one."""
        steps = (Step("mine", mine), Step("drive", estimate.camera_from_lidar))
        return cls(number, frame, f"drive of {estimate.frames} frames", steps, estimate.verdict, milliseconds)

    def as_dict(self, reference: Extrinsic | None) -> dict[str, Any]:
        """The message for the page, with errors in degrees and centimetres if the reference is known."""
        verdict = self.verdict
        return {
            "number": self.number,
            "frame": self.frame,
            "title": self.title,
            "milliseconds": round(self.milliseconds),
            "steps": [
                {
                    "name": step.name,
                    "extrinsic": step.camera_from_lidar.ravel().tolist(),
                    "error": figures(step.camera_from_lidar, reference),
                    "moved": figures(step.camera_from_lidar, self.steps[max(0, position - 1)].camera_from_lidar),
                }
                for position, step in enumerate(self.steps)
            ],
            "verdict": None if verdict is None else _verdict_dict(verdict),
            "sigma": None
            if verdict is None or verdict.covariance is None
            else [verdict.sigma_rotation_deg, verdict.sigma_translation_cm],
        }


def figures(extrinsic: Extrinsic, other: Extrinsic | None) -> list[float] | None:
    """Degrees and centimetres between two extrinsics; None if one is unknown."""
    if other is None:
        return None
    error = pose_error(extrinsic, other)
    return [error.rotation_deg, error.translation_cm]


def _verdict_dict(verdict: Verdict) -> dict[str, str]:
    """The word, the finest tolerance that the result is certain to be within (empty for none), and the explanation."""
    within = "" if verdict.within is None else f"within {verdict.within}"
    return {"word": verdict.word, "within": within, "text": explained(verdict)}
