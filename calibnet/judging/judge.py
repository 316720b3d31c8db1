"""The verdict on one frame: cheap checks first, then what the run itself tells, then, where that was asked for, why."""

from __future__ import annotations

import math

from calibnet.datasets.frame import Frame
from calibnet.datasets.plausibility import ROW_STEP, Implausible, bit_depth, of_camera, of_extrinsic, ranges, up
from calibnet.geometry.types import Extrinsic
from calibnet.judging.causes import PICTURE_AND_SCAN, Measure, Search, cause
from calibnet.judging.coefficients import Coefficients
from calibnet.judging.covariance import covariance
from calibnet.judging.lens_causes import lens_causes
from calibnet.judging.predictors import predictors, reach
from calibnet.trace import MARGIN, CascadeTrace
from calibnet.verdict import ACCEPTED, CANNOT_TELL, REJECTED, Cause, Verdict, Word, moved

FARTHEST_REACH = 1.6
"""Ranges searched beyond which a run is surely wrong; between `MARGIN` and this it may have started outside them."""
UNRELATED_PX = 8.0
"""Expected match error beyond which nothing in the picture belongs to the scan."""
BLANK = 2.0
"""Standard deviation of each colour under which a picture shows nothing."""


def judge(
    frame: Frame,
    guess: Extrinsic,
    trace: CascadeTrace | None,
    coefficients: Coefficients,
    match_error: Measure | None = None,
    lag: tuple[Search, Measure] | None = None,
    prior: str = "",
) -> Verdict:
    """Judge what a cascade made of a frame; the frame's own extrinsic is not looked at.

    Args:
        frame: that was calibrated.
        guess: ``camera_from_lidar`` that it started from, 4x4.
        trace: of the run; None where it could not be run because too few points fall into the picture.
        coefficients: that were fitted to the weights; without any nothing is accepted.
        match_error: given, it is found out why a result is not accepted: where picture and scan do not fit, by this
            measure and `calibnet.judging.causes.PICTURE_AND_SCAN`, then by the lens that the matches ask for.
        lag: where they fit out of the range searched, and no lens explains it: `calibnet.judging.lag.lags` and how
            far a run goes.
        prior: what the user knows of the extrinsic beforehand, in words. The classifier was fitted to runs in which all
            six axes are free. Such runs err mostly along axes that a prior may fix, so with a prior it can accept a
            result, but never reject it.
    """
    # Whether the cloud is several scans was asked, and remarked, when the frame was prepared.
    of_scan = ranges(frame.points), up(frame.points)
    checks = [*of_camera(frame.camera), *of_extrinsic(guess), *of_scan, bit_depth(frame.image)]
    seen = [remark for remark in checks if remark is not None]
    said = {remark.name for remark in seen}
    remarks = [*seen, *(remark for remark in frame.remarks if remark.name not in said)]  # those of when it was read
    suspects = tuple(map(_suspect, remarks))

    def why(search: Search, measure: Measure | None) -> tuple[Cause, ...]:
        return suspects or (() if measure is None else cause(search, frame, guess, measure))

    def why_lens() -> tuple[Cause, ...]:
        return suspects or (() if match_error is None or trace is None else lens_causes(trace, coefficients.lens))

    if trace is None or not trace.stages:
        causes = why(PICTURE_AND_SCAN, match_error)
        reason = "Hardly any point of the scan falls into the picture under the extrinsic that the run started from."
        return Verdict(REJECTED, _because(reason, causes), guess, causes=causes)

    last = trace.stages[-1]

    def verdict(word: Word, reason: str, causes: tuple[Cause, ...] = ()) -> Verdict:
        going = moved(trace.initial, last.after)
        return Verdict(
            word, _because(reason, causes), last.after, going, causes, covariance(trace, coefficients.covariance)
        )

    if float(frame.image[::ROW_STEP].std(axis=(0, 1)).max()) < BLANK:
        return verdict(REJECTED, "The picture shows nothing.")
    if any(remark.certain for remark in remarks):
        return verdict(REJECTED, "The input is not plausible.", suspects)
    if not trace.fits:
        reason = (
            f"Picture and scan do not fit together: matches are expected to be {last.match_error_px:.1f} px off, "
            f"at most {trace.match_error_limit_px:g} px are usual."
        )
        causes = why(PICTURE_AND_SCAN, match_error)
        if not causes and match_error is not None:
            if last.match_error_px > UNRELATED_PX:
                text = "They seem to be of different places, or the start is far outside the range searched."
                causes = (
                    Cause("other-picture", text, f"{last.match_error_px:.1f} px, and nothing tried makes them fit"),
                )
            else:
                causes = why_lens()
        return verdict(REJECTED, reason, causes)
    gone = reach(trace.initial, last.after, trace.stages[0].range)
    if gone.share > MARGIN:
        word: Word = REJECTED if gone.share > FARTHEST_REACH else CANNOT_TELL
        return verdict(word, f"The LiDAR {gone}.", why_lens() or (why(*lag) if lag else ()))

    classifier = coefficients.for_frame(last.range)
    if isinstance(classifier, str):
        return verdict(
            CANNOT_TELL, f"Picture and scan fit together, but how sure that is cannot be told. {classifier}", suspects
        )
    wrong = classifier(predictors(trace))
    if wrong < classifier.accepted_below:
        return verdict(ACCEPTED, f"Picture and scan fit together (match error {last.match_error_px:.1f} px).")
    if math.isnan(wrong):
        return verdict(CANNOT_TELL, "What the network tells of its matches is not enough to judge them.", suspects)
    reason = f"Picture and scan fit, but not as well as in runs that end right (an error is {wrong:.0%} likely)."
    if prior:
        reason = (
            "Picture and scan fit, but not as well as in runs that end right (if no axis were known, an error would be "
            f"{wrong:.0%} likely; with {prior} it is less so, how much cannot be told)."
        )
        return verdict(CANNOT_TELL, reason, why_lens())
    return verdict(REJECTED if wrong > classifier.rejected_above else CANNOT_TELL, reason, why_lens())


def _suspect(remark: Implausible) -> Cause:
    """What is unlikely about a frame, as a cause."""
    return Cause(remark.name, f"{remark.text[0].upper()}{remark.text[1:]}.", "the numbers as they were given")


def _because(reason: str, causes: tuple[Cause, ...]) -> str:
    """The reason, and the likeliest cause."""
    return f"{reason} {causes[0].text}" if causes else reason
