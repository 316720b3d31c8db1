"""The verdict on the calibration that a run starts from; on doubt some frames are asked for the cause."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

from calibnet.calibrator import Explainer
from calibnet.datasets.frame import Frames
from calibnet.datasets.selection import evenly_spaced
from calibnet.errors import CalibrationError, DatasetError
from calibnet.geometry.types import Extrinsic
from calibnet.judging.lag import lags
from calibnet.judging.verify import Standard, named_cause, unfit, verify
from calibnet.verdict import ACCEPTED, Cause, Verdict
from inspector.verdicts import causes_of

SUSPECTS = 3
"""Frames, spread over a drive, that are asked for the cause: each runs stages up to thirty times."""


def judge_initial(method: object, frames: Frames, given: Extrinsic, found: Verdict, standard: Standard) -> Verdict:
    """Hold a calibration against what was found from it; unless it is accepted, look for the causes.

    Args:
        method: that found it, asked for causes if it is one of `calibnet.calibrator.Explainer`.
        frames: where it was found.
        given: ``camera_from_lidar`` to verify, 4x4.
        found: verdict on what was found.
        standard: that it is held to, see `calibnet.judging.verify.verify`.
    """
    if getattr(method, "unjudged", ""):  # its results may be off by anything
        standard = replace(standard, farthest=None)
    verdict = verify(given, found, standard)
    if verdict.word == ACCEPTED or found.causes:
        return verdict
    return verify(given, replace(found, causes=suspected(method, frames, given)), standard)


def suspected(method: object, frames: Frames, given: Extrinsic) -> tuple[Cause, ...]:
    """The causes that half or more of some frames, each by itself, name; those of most frames first."""
    if not isinstance(method, Explainer):
        return ()
    verdicts: list[Verdict] = []
    for position in evenly_spaced(len(frames), SUSPECTS):
        try:
            verdicts.append(method.explain(frames[position], given, lags(frames, position)))
        except (CalibrationError, DatasetError) as error:
            verdicts.append(unfit(given, str(error), named_cause(error)))
    named = Counter(name for verdict in verdicts for name in {cause.name for cause in verdict.causes})
    return tuple(cause for cause in causes_of(verdicts) if 2 * named[cause.name] >= len(verdicts))
