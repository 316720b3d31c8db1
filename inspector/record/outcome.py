"""The outcome of a run as properties of its recording, by which a catalogue of recordings sorts and filters."""

from __future__ import annotations

from typing import Any

import rerun as rr

from calibnet.geometry import pose_error
from calibnet.geometry.types import Extrinsic
from calibnet.runtime.text import one_line
from calibnet.verdict import Verdict


def outcome_values(verdict: Verdict, reference: Extrinsic | None = None) -> rr.AnyValues:
    """The columns: word, causes, correction in degrees and centimetres, sigma and error if known, number of frames."""
    sigma = (verdict.sigma_rotation_deg, verdict.sigma_translation_cm)
    error = (None, None) if reference is None else _error(verdict.camera_from_lidar, reference)
    values: dict[str, Any] = {
        "word": verdict.word,
        "cause": ", ".join(cause.name for cause in verdict.causes),
        "reason": one_line(verdict.reason),
        **_pair("moved", *verdict.moved),
        **_pair("sigma", *sigma),
        **_pair("error", *error),
        "frames_used": verdict.used,
        "frames_skipped": len(verdict.skipped),
    }
    return rr.AnyValues(**{name: value for name, value in values.items() if value is not None})


def _error(found: Extrinsic, reference: Extrinsic) -> tuple[float, float]:
    error = pose_error(found, reference)
    return error.rotation_deg, error.translation_cm


def _pair(name: str, rotation_deg: float | None, translation_cm: float | None) -> dict[str, float | None]:
    return {f"{name}_deg": rotation_deg, f"{name}_cm": translation_cm}
