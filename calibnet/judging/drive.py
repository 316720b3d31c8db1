"""The verdict on a drive."""

from __future__ import annotations

import math

from calibnet.geometry import MiscalibrationRange
from calibnet.geometry.types import Extrinsic
from calibnet.judging.classifier import Classifier
from calibnet.judging.drive_predictors import aligned_cm, drive_predictors, halves_cm
from calibnet.judging.predictors import reach
from calibnet.trace import MARGIN, DriveEstimate
from calibnet.verdict import ACCEPTED, CANNOT_TELL, DRIVE_LIMITS, REJECTED, Verdict, Word, moved

LARGEST_SIGMA_DEG, LARGEST_SIGMA_CM = 0.3, 12.0
"""Standard deviations, over all axes, beyond which the frames agree on too little."""
FEWEST_JUDGED = 4
"""Frames that a drive needs to be accepted: of two or three, which mostly show one place, as many end beyond the limits
as within, and nothing tells which (docs/decisions.md, "Drives")."""
HALVES_CM, ALIGNED_CM = 15.0, 7.0
"""Between the halves of a drive, and between what its networks and its edges say, from which on it is told; turns
counted as `calibnet.judging.drive_predictors` does."""


def judge_drive(
    estimate: DriveEstimate, initial: Extrinsic, searched: MiscalibrationRange, classifier: Classifier | str
) -> Verdict:
    """Whether the extrinsic that was solved from a drive is good.

    Args:
        estimate: of the drive.
        initial: ``camera_from_lidar`` that it started from.
        searched: the range that was to be searched around it.
        classifier: as `calibnet.judging.coefficients.Coefficients.for_drive` has it; without one nothing is accepted.
    """
    word, reason = _word(estimate, initial, searched, classifier)
    there = estimate.camera_from_lidar
    return Verdict(
        word, reason, there, moved(initial, there), (), estimate.covariance, estimate.frames, estimate.skipped
    )


def _word(
    estimate: DriveEstimate, initial: Extrinsic, searched: MiscalibrationRange, classifier: Classifier | str
) -> tuple[Word, str]:
    used, skipped = estimate.frames, len(estimate.skipped)
    if 2 * skipped >= used + skipped:
        return REJECTED, f"Only {used} of {used + skipped} frames could be used. {estimate.skipped[0].why}"
    turned, shifted = moved(initial, estimate.camera_from_lidar)
    if reach(initial, estimate.camera_from_lidar, searched).share > MARGIN:
        return REJECTED, (
            f"It lies {turned:.2g}° and {shifted:.0f} cm from the start, out of the range that was to be searched, "
            f"{searched.label}: a wrong lens or late scans look like that. If the start may be that far off, let all "
            "stages run (--stages 1-5)."
        )
    if estimate.rotation_deg > LARGEST_SIGMA_DEG or estimate.translation_cm > LARGEST_SIGMA_CM:
        return CANNOT_TELL, (
            f"The frames leave it open to {estimate.rotation_deg:.2g}° and {estimate.translation_cm:.0f} cm (one "
            "standard deviation); more frames of other places help."
        )
    if isinstance(classifier, str):
        return CANNOT_TELL, f"{used} frames agree, but how sure that is cannot be told. {classifier}"
    if used < FEWEST_JUDGED:
        return CANNOT_TELL, f"{used} frames agree; to be sure of a drive takes {FEWEST_JUDGED}, better of other places."
    predictors = drive_predictors(estimate)
    if predictors is None:
        return CANNOT_TELL, "What is told of its frames is not enough to judge the drive."
    wrong = classifier(predictors)
    if wrong < classifier.accepted_below:
        return ACCEPTED, f"{used} frames agree."
    if math.isnan(wrong):
        return CANNOT_TELL, "What is told of its frames is not enough to judge the drive."
    halves, aligned = halves_cm(estimate.looks), aligned_cm(estimate)
    why = [f"its halves are {halves:.0f} cm apart"] if halves > HALVES_CM else []
    if aligned > ALIGNED_CM:
        why.append(f"edges lie {aligned:.0f} cm from what the networks say, and either may be right")
    return CANNOT_TELL, (  # not rejected: many of those that are off are off by little more
        f"{used} frames agree, but not as those of drives that end right do (that it is more than "
        f"{DRIVE_LIMITS[0]:g}° or {DRIVE_LIMITS[1]:g} cm off is {wrong:.0%} likely)"
        f"{''.join(f'; {one}' for one in why)}."
    )
