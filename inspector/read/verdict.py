"""Verdicts of a recording: the JSON object that `calibnet.verdict.Verdict.as_dict` makes, back to its type."""

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
from calibnet.verdict import ACCEPTED, REJECTED, BadFrame, Cause, Verdict, Word, moved
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
    """The object as JSON has it."""

    verdict: Word
    reason: str
    causes: tuple[Cause, ...]
    camera_from_lidar: tuple[tuple[float, ...], ...]
    moved: _Moved
    sigma: _Sigma | None
    frames: _Frames


def read_verdict(text: str, path: Path) -> Verdict:
    """The verdict of a JSON text in the recording ``path``.

    Raises:
        RecordingError: it is none.
        ValueError: it is no JSON, or its extrinsic is none.
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
    )


def former_verdict(initial: Extrinsic, corrected: Extrinsic, stages: Mapping[int, Extrinsic]) -> Verdict:
    """That of a frame whose recording has none: what the last stage found was applied, or was not believed.

    Args:
        initial: ``camera_from_lidar`` that the frame started from.
        corrected: its result.
        stages: ``camera_from_lidar`` after every stage, by its number.
    """
    arrived = stages[max(stages)] if stages else initial
    applied = np.array_equal(corrected, arrived)
    reason = "Picture and scan fit together." if applied else "Picture and scan do not fit together."
    return Verdict(ACCEPTED if applied else REJECTED, reason, arrived, moved(initial, arrived))
