"""Verdicts of a recording: the JSON object that `calibnet.verdict.Verdict.as_dict` makes, back to its type."""

from __future__ import annotations

import json
from collections.abc import Mapping

import numpy as np

from calibnet.geometry.types import Extrinsic
from calibnet.verdict import ACCEPTED, REJECTED, BadFrame, Cause, Verdict, moved


def read_verdict(text: str) -> Verdict:
    """The verdict of a JSON text."""
    content = json.loads(text)
    sigma = content["sigma"]
    return Verdict(
        word=content["verdict"],
        reason=content["reason"],
        camera_from_lidar=np.array(content["camera_from_lidar"]),
        moved=(content["moved"]["rotation_deg"], content["moved"]["translation_cm"]),
        causes=tuple(Cause(**cause) for cause in content["causes"]),
        covariance=None if sigma is None else np.array(sigma["covariance"]),
        used=content["frames"]["used"],
        skipped=tuple(BadFrame(**bad) for bad in content["frames"]["skipped"]),
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
