"""The verdict on one frame: plausibility checks, then the run itself and, on request, the search for causes."""

from __future__ import annotations

import math

from calibnet.datasets.clouds.plausibility import ranges, up
from calibnet.datasets.frame import Frame
from calibnet.datasets.images.plausibility import ROW_STEP, bit_depth
from calibnet.datasets.plausibility import Implausible, of_camera, of_extrinsic
from calibnet.geometry.types import Extrinsic
from calibnet.judging.advice import MORE_FRAMES, RICHER_SCENE, out_of_range
from calibnet.judging.causes import IMAGE_AND_SCAN, Measure, Search, cause
from calibnet.judging.coefficients import Coefficients
from calibnet.judging.covariance import covariance
from calibnet.judging.lens_causes import lens_causes
from calibnet.judging.predictors import predictors, reach
from calibnet.trace import MARGIN, CascadeTrace
from calibnet.verdict import (
    ACCEPTED,
    CANNOT_TELL,
    FRAME_LIMITS,
    FRAME_TOLERANCES,
    REJECTED,
    Cause,
    Tolerance,
    Verdict,
    Word,
    moved,
)

FARTHEST_REACH = 1.6
"""Reach beyond which a run is certainly wrong; between `MARGIN` and this it may have started outside the range."""
UNRELATED_PX = 8.0
"""Match error, in pixels of the stage's image, beyond which image and scan have nothing in common."""
BLANK = 2.0
"""Standard deviation of every colour channel below which an image counts as blank."""


def judge(
    frame: Frame,
    guess: Extrinsic,
    trace: CascadeTrace | None,
    coefficients: Coefficients,
    match_error: Measure | None = None,
    lag: tuple[Search, Measure] | None = None,
    prior: str = "",
) -> Verdict:
    """Judge the cascade's result for a frame, without using the frame's own extrinsic.

    Args:
        frame: the frame that was calibrated.
        guess: ``camera_from_lidar`` that the run started from, 4x4.
        trace: of the run; None if too few points fell into the image to run it.
        coefficients: fitted to the weights; without any nothing is accepted.
        match_error: if given, causes are searched for a result that is not accepted: if image and scan do not fit,
            with this measure and `calibnet.judging.causes.IMAGE_AND_SCAN`, then by fitting the lens to the matches.
        lag: attempts of `calibnet.judging.lag.lags` and their measure, used if image and scan fit outside the range
            searched, or hardly; a fault of the lens is looked for only if no lag explains it.
        prior: what the user knows of the extrinsic beforehand, in words. The classifier was fitted to runs in which all
            six axes are free. Such runs err mostly along axes that a prior may fix, so with a prior it can accept a
            result, but never reject it.
    """
    # Accumulated clouds were already detected, and remarked on, when the frame was prepared.
    of_scan = ranges(frame.points), up(frame.points)
    checks = [*of_camera(frame.camera), *of_extrinsic(guess), *of_scan, bit_depth(frame.image)]
    seen = [remark for remark in checks if remark is not None]
    said = {remark.name for remark in seen}
    remarks = [*seen, *(remark for remark in frame.remarks if remark.name not in said)]  # found when it was read
    suspects = tuple(map(_suspect, remarks))

    def why(search: Search, measure: Measure | None) -> tuple[Cause, ...]:
        return suspects or (() if measure is None else cause(search, frame, guess, measure))

    def why_lag(share: float) -> tuple[Cause, ...]:
        return suspects or (cause(lag[0], frame, guess, lag[1], share) if lag else ())

    def why_lens() -> tuple[Cause, ...]:
        return suspects or (() if match_error is None or trace is None else lens_causes(trace, coefficients.lens))

    word: Word
    if trace is None or not trace.stages:
        causes = why(IMAGE_AND_SCAN, match_error)
        reason = "Hardly any point of the scan falls into the image under the initial extrinsic."
        return Verdict(REJECTED, _because(reason, causes), guess, causes=causes)

    last = trace.stages[-1]

    def verdict(
        word: Word, reason: str, causes: tuple[Cause, ...] = (), within: Tolerance | None = None, advice: str = ""
    ) -> Verdict:
        going, spread = moved(trace.initial, last.after), covariance(trace, coefficients.covariance)
        advice = "" if causes else advice  # a cause says what to do
        return Verdict(word, _because(reason, causes), last.after, going, causes, spread, within=within, advice=advice)

    if any(remark.certain for remark in remarks):
        return verdict(REJECTED, "The input is not plausible.", suspects)
    if float(frame.image[::ROW_STEP].std(axis=(0, 1)).max()) < BLANK:
        return verdict(REJECTED, "The image is blank.")
    if not trace.fits:
        error, limit = (last.in_image(px, frame.camera) for px in (last.match_error_px, trace.match_error_limit_px))
        reason = (
            f"Image and scan do not fit together: the expected match error is {error:.1f} px, where at most "
            f"{limit:.1f} px is usual."
        )
        causes = why(IMAGE_AND_SCAN, match_error)
        if not causes and match_error is not None:
            if last.match_error_px > UNRELATED_PX:
                text = "They seem to show different places, or the start is far outside the range searched."
                causes = (
                    Cause(
                        "other-picture",
                        text,
                        f"{error:.1f} px, and no correction that was tried makes them fit",
                    ),
                )
            else:
                causes = why_lag(math.inf) or why_lens()
        return verdict(REJECTED, reason, causes)
    gone = reach(trace.initial, last.after, trace.stages[0].range)
    if gone.share > MARGIN:
        word = REJECTED if gone.share > FARTHEST_REACH else CANNOT_TELL
        causes, advice = why_lag(gone.share) or why_lens(), out_of_range(trace.stages[0].range)
        return verdict(word, f"The LiDAR {gone}.", causes, advice=advice)

    classifier = coefficients.for_frame(last.range)
    if isinstance(classifier, str):
        return verdict(
            CANNOT_TELL,
            f"Image and scan fit together, but how reliable that is cannot be judged. {classifier}",
            suspects,
        )
    known = predictors(trace)
    wrong, within = classifier(known), classifier.finest(known, FRAME_TOLERANCES)
    if within == FRAME_LIMITS:
        return verdict(ACCEPTED, "Image and scan fit together.", within=within)
    if math.isnan(wrong):
        reason = "The matches hold too little information to judge the result."
        return verdict(CANNOT_TELL, reason, suspects, advice=RICHER_SCENE)
    fit = f"Image and scan fit together, but the result is not certain to be within {FRAME_LIMITS}"
    causes = why_lens()
    within = None if causes else within  # nothing is certain of a result that a fault may explain
    if within is not None:
        fit = f"Image and scan fit together, and the result is within {within}, but perhaps not within {FRAME_LIMITS}"
    known_beforehand = f" without prior knowledge, less with {prior}" if prior else ""
    reason = f"{fit} (probability of a larger error: {wrong:.0%}{known_beforehand})."
    word = REJECTED if not prior and within is None and wrong > classifier.rejected_above else CANNOT_TELL
    return verdict(word, reason, causes, within, MORE_FRAMES)


def _suspect(remark: Implausible) -> Cause:
    """An implausible property of a frame, as a cause."""
    return Cause(remark.name, f"{remark.text[0].upper()}{remark.text[1:]}.", "the numbers in the input")


def _because(reason: str, causes: tuple[Cause, ...]) -> str:
    """The reason, followed by the most likely cause."""
    return f"{reason} {causes[0].text}" if causes else reason
