"""The verdict on the calibration that a run starts from, with the causes if it is not accepted."""

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
"""Number of frames, spread over a drive, in which causes are looked for; each runs stages up to thirty times."""


def judge_initial(method: object, frames: Frames, given: Extrinsic, found: Verdict, standard: Standard) -> Verdict:
    """Compare a calibration with the result of a run that started from it; unless accepted, look for causes.

    Args:
        method: the method that ran, which names causes if it is a `calibnet.calibrator.Explainer`.
        frames: frames of the run.
        given: ``camera_from_lidar`` to verify, 4x4.
        found: verdict on the run's result.
        standard: limits to apply, see `calibnet.judging.verify.verify`.
    """
    if getattr(method, "unjudged", ""):  # its results prove nothing
        standard = replace(standard, farthest=None)
    verdict = verify(given, found, standard)
    if verdict.word == ACCEPTED or found.causes:
        return verdict
    return verify(given, replace(found, causes=suspected(method, frames, given)), standard)


def suspected(method: object, frames: Frames, given: Extrinsic) -> tuple[Cause, ...]:
    """The causes found independently in at least half of some frames, the most frequent first."""
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
