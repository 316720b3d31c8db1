"""The verdict on a drive."""

from __future__ import annotations

import math
from typing import NamedTuple

from calibnet.geometry import MiscalibrationRange
from calibnet.geometry.se3 import degrees_and_cm
from calibnet.geometry.types import Extrinsic
from calibnet.judging.advice import (
    CONTRADICTION,
    MORE_DRIVES,
    MORE_PLACES,
    RICHER_SCENE,
    SCATTER,
    out_of_range,
)
from calibnet.judging.classifier import Classifier
from calibnet.judging.covariance import known_within
from calibnet.judging.drive_lens import drive_lens_causes, motion_lens_causes
from calibnet.judging.drive_predictors import aligned_cm, drive_predictors, halves_cm
from calibnet.judging.lens_causes import LensOdds
from calibnet.judging.predictors import reach
from calibnet.runtime.text import number_of
from calibnet.trace import MARGIN, DriveEstimate
from calibnet.verdict import (
    ACCEPTED,
    CANNOT_TELL,
    DRIVE_LIMITS,
    DRIVE_TOLERANCES,
    REJECTED,
    Cause,
    Tolerance,
    Verdict,
    Word,
    moved,
)

LARGEST_SIGMA_DEG, LARGEST_SIGMA_CM = 0.3, 12.0
"""Largest standard deviations, over all axes, of a drive that is judged."""
FEWEST_JUDGED = 4
"""Fewest frames of a drive that can be accepted; those of several cameras at one moment count once. Two or three mostly
show one place, most such drives end outside the limits, and no predictor tells which (docs/decisions.md, "Drives")."""
MANY_FRAMES = 100
"""Frames of a drive beyond which more of them are not advised."""
HALVES_CM, ALIGNED_CM = 15.0, 7.0
"""Differences between the halves of a drive, and between its networks and its edges, above which the reason mentions
them; rotations are converted as in `calibnet.judging.drive_predictors`."""


def judge_drive(
    estimate: DriveEstimate,
    initial: Extrinsic,
    searched: MiscalibrationRange,
    classifier: Classifier | str,
    lens: LensOdds | None = None,
) -> Verdict:
    """Whether the extrinsic that was solved from a drive is good.

    Args:
        estimate: of the drive.
        initial: ``camera_from_lidar`` that the drive started from.
        searched: range that was to be searched around the initial extrinsic.
        classifier: from `calibnet.judging.coefficients.Coefficients.for_drive`; without one nothing is accepted.
        lens: names a fault of the lens, see `calibnet.judging.drive_lens`; without it none is named.
    """
    causes = motion_lens_causes(estimate.motion) or drive_lens_causes(estimate.looks, lens, FEWEST_JUDGED)
    concluded = _conclude(estimate, initial, searched, classifier, causes)
    within, covariance = concluded.within, estimate.covariance
    return Verdict(
        concluded.word,
        concluded.reason,
        estimate.camera_from_lidar,
        moved(initial, estimate.camera_from_lidar),
        causes,
        covariance=covariance if within is None else known_within(covariance, within),
        used=estimate.frames,
        skipped=estimate.skipped,
        within=within,
        advice=concluded.advice,
    )


class _Conclusion(NamedTuple):
    """The word of a verdict, the reason, what to do next, and the tolerance that the result is within."""

    word: Word
    reason: str
    advice: str = ""
    within: Tolerance | None = None


def _conclude(
    estimate: DriveEstimate,
    initial: Extrinsic,
    searched: MiscalibrationRange,
    classifier: Classifier | str,
    causes: tuple[Cause, ...],
) -> _Conclusion:
    used, skipped = estimate.frames, len(estimate.skipped)
    if 2 * skipped >= used + skipped:
        return _Conclusion(REJECTED, f"Only {used} of {used + skipped} frames could be used. {estimate.skipped[0].why}")
    if causes:
        return _Conclusion(REJECTED, f"Its frames show a fault of the lens. {causes[0].text}")
    turned, shifted = moved(initial, estimate.camera_from_lidar)
    if reach(initial, estimate.camera_from_lidar, searched).share > MARGIN:
        return _Conclusion(
            REJECTED,
            f"The result lies {turned:.2g}° and {shifted:.0f} cm from the start, outside the range searched "
            f"({searched.label}).",
            out_of_range(searched),
        )
    contradiction = _contradiction(estimate)
    if contradiction:
        return _Conclusion(CANNOT_TELL, contradiction, CONTRADICTION)
    if estimate.rotation_deg > LARGEST_SIGMA_DEG or estimate.translation_cm > LARGEST_SIGMA_CM:
        return _Conclusion(
            CANNOT_TELL,
            f"The frames determine the extrinsic only to {estimate.rotation_deg:.2g}° and "
            f"{estimate.translation_cm:.0f} cm (1σ).",
            SCATTER,
        )
    if isinstance(classifier, str):
        return _Conclusion(CANNOT_TELL, f"{used} frames agree, but how reliable that is cannot be judged. {classifier}")
    moments = min(used, len({look.position for look in estimate.looks}) or used)
    if moments < FEWEST_JUDGED:
        of_them = "" if moments == used else f" of {number_of(moments, 'moment')}"
        few = f"A drive is judged by at least {FEWEST_JUDGED} frames of different moments"
        return _Conclusion(CANNOT_TELL, f"{few}; this one has {number_of(used, 'frame')}{of_them}.", MORE_PLACES)
    predictors = drive_predictors(estimate)
    if predictors is None:
        return _Conclusion(CANNOT_TELL, "Its frames hold too little information to judge the drive.", RICHER_SCENE)
    within = classifier.finest(predictors, DRIVE_TOLERANCES)
    if within == DRIVE_LIMITS:
        return _Conclusion(ACCEPTED, f"{used} frames agree.", within=within)
    wrong = classifier(predictors)
    if math.isnan(wrong):
        return _Conclusion(CANNOT_TELL, "Its frames hold too little information to judge the drive.", RICHER_SCENE)
    halves, aligned = halves_cm(estimate.looks), aligned_cm(estimate)
    why = [f"the halves of the drive differ by {halves:.0f} cm"] if halves > HALVES_CM else []
    if aligned > ALIGNED_CM:
        why.append(f"edges and networks differ by {aligned:.0f} cm, and either may be right")
    certain = f"not certain to be within {DRIVE_LIMITS}"
    if within is not None:
        certain = f"within {within}, but perhaps not within {DRIVE_LIMITS}"
    return _Conclusion(
        CANNOT_TELL,  # not rejected: many drives beyond the limits are only a little beyond them
        f"The result of {used} frames is {certain} (probability of a larger error: {wrong:.0%})"
        f"{''.join(f'; {one}' for one in why)}.",
        MORE_PLACES if used < MANY_FRAMES else MORE_DRIVES,
        within,
    )


def _contradiction(estimate: DriveEstimate) -> str:
    """What the motion of the car shows, if it contradicts the frames; empty if it does not."""
    motion = estimate.motion
    if motion is None or not motion.certain or not estimate.contradicts(motion):
        return ""
    turned, shifted = moved(estimate.camera_from_lidar, motion.camera_from_lidar)
    return (
        f"The motion of the car contradicts the result of {number_of(estimate.frames, 'frame')}: with an extrinsic "
        f"{degrees_and_cm(turned, shifted)} away, image motion fits the scans better."
    )
