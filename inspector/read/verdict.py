"""Reads verdicts from a recording: the JSON object of `calibnet.verdict.Verdict.as_dict`, parsed to a `Verdict`."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from annotated_types import Interval, Len

from calibnet.geometry.types import Extrinsic
from calibnet.runtime.schema import validated
from calibnet.verdict import ACCEPTED, REJECTED, BadFrame, Cause, Tolerance, Verdict, Word, moved
from inspector.read.understood import RecordingError, extrinsic_of

Count = Annotated[int, Interval(ge=0, le=10**9)]
Six = Annotated[tuple[float, ...], Len(6, 6)]


@dataclass(frozen=True)
class _Moved:
    rotation_deg: float
    translation_cm: float


@dataclass(frozen=True)
class _Sigma:
    covariance: Annotated[tuple[Six, ...], Len(6, 6)]


@dataclass(frozen=True)
class _Frames:
    used: Count
    skipped: tuple[BadFrame, ...]


@dataclass(frozen=True)
class _Said:
    """The JSON object."""

    verdict: Word
    reason: str
    causes: tuple[Cause, ...]
    camera_from_lidar: tuple[tuple[float, ...], ...]
    moved: _Moved
    sigma: _Sigma | None
    frames: _Frames
    within: Tolerance | None = None
    advice: str = ""


def read_verdict(text: str, path: Path) -> Verdict:
    """Parse a verdict in the recording ``path``.

    Raises:
        RecordingError: it is not a valid verdict.
        ValueError: it is not JSON, or its extrinsic is not a rigid transform.
    """
    said = validated(_Said, json.loads(text), f"{path}: a verdict", RecordingError, "record it again")
    covariance = None if said.sigma is None else np.array(said.sigma.covariance)
    return Verdict(
        word=said.verdict,
        reason=said.reason,
        camera_from_lidar=extrinsic_of(said.camera_from_lidar),
        moved=(said.moved.rotation_deg, said.moved.translation_cm),
        causes=said.causes,
        covariance=covariance if covariance is not None and np.isfinite(covariance).all() else None,
        used=said.frames.used,
        skipped=said.frames.skipped,
        within=said.within,
        advice=said.advice,
    )


def inferred_verdict(initial: Extrinsic, corrected: Extrinsic, stages: Mapping[int, Extrinsic]) -> Verdict:
    """The verdict on a frame of a recording without verdicts, inferred from whether the last result was applied.

    Args:
        initial: the frame's initial ``camera_from_lidar``.
        corrected: its result.
        stages: ``camera_from_lidar`` after every stage, by its number.
    """
    arrived = stages[max(stages)] if stages else initial
    applied = np.array_equal(corrected, arrived)
    reason = "Image and scan fit together." if applied else "Image and scan do not fit together."
    return Verdict(ACCEPTED if applied else REJECTED, reason, arrived, moved(initial, arrived))
