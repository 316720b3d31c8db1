"""The verdict on one frame: cheap checks first, then what the run itself tells, then, on doubt, why."""

from __future__ import annotations

from collections.abc import Callable

from calibnet.datasets.frame import Frame
from calibnet.geometry.types import Extrinsic
from calibnet.trace import CascadeTrace, StageTrace
from calibnet.verdict.causes import LENSES, PICTURE_AND_SCAN, Measure, cause
from calibnet.verdict.covariance import covariance
from calibnet.verdict.plausibility import implausible, is_blank
from calibnet.verdict.verdict import ACCEPTED, CANNOT_TELL, REJECTED, Cause, Verdict, Word, moved
from calibnet.verdict.witnesses import Doubt, load_doubt, reach, witnesses

FARTHEST_REACH = 1.6
"""Ranges that a run may go on any axis: a start at the border, and what a good result may still be off."""
UNRELATED_PX = 8.0
"""Expected match error beyond which nothing in the picture belongs to the scan."""


def judge(
    frame: Frame,
    guess: Extrinsic,
    trace: CascadeTrace | None,
    again: StageTrace | None = None,
    match_error: Measure | None = None,
    misfit: Measure | None = None,
    doubt: Doubt | None = None,
) -> Verdict:
    """Judge what a cascade made of a frame; the frame's own extrinsic is not looked at.

    Args:
        frame: that was calibrated.
        guess: ``camera_from_lidar`` that it started from, 4x4.
        trace: of the run; None where it could not be run because too few points fall into the picture.
        again: one more look of the last stage from where the run arrived; without it less is accepted.
        match_error: where picture and scan do not fit, finds out why by `calibnet.verdict.causes.PICTURE_AND_SCAN`.
        misfit: where they fit, but not well enough, finds out why by `calibnet.verdict.causes.LENSES`.
        doubt: how witnesses are summed up; by default as it was fitted to the weights that ship with the package.
    """
    found = implausible(frame)

    def why(search: Callable[[], tuple[Cause, ...]] | None) -> tuple[Cause, ...]:
        return found or (search() if search is not None else ())

    def by_picture_and_scan() -> tuple[Cause, ...]:
        return cause(PICTURE_AND_SCAN, frame, guess, match_error) if match_error is not None else ()

    def by_lens() -> tuple[Cause, ...]:
        return cause(LENSES, frame, guess, misfit) if misfit is not None else ()

    if trace is None or not trace.stages:
        causes = why(by_picture_and_scan)
        reason = "Hardly any point of the scan falls into the picture under the extrinsic that the run started from."
        return Verdict(REJECTED, _because(reason, causes), guess, causes=causes)

    last = trace.stages[-1]

    def verdict(word: Word, reason: str, causes: tuple[Cause, ...] = ()) -> Verdict:
        going = moved(trace.initial, last.after)
        return Verdict(word, _because(reason, causes), last.after, going, causes, covariance(last))

    if is_blank(frame):
        return verdict(REJECTED, "The picture shows nothing.")
    if found:
        return verdict(REJECTED, "The input is not plausible.", found)
    if last.match_error_px > trace.match_error_limit_px:
        reason = (
            f"Picture and scan do not fit together: matches are expected to be {last.match_error_px:.1f} px off, "
            f"at most {trace.match_error_limit_px:g} px are usual."
        )
        causes = by_picture_and_scan()
        if not causes and match_error is not None and last.match_error_px > UNRELATED_PX:
            text = "They seem to be of different places, or the start is far outside the range searched."
            causes = (Cause("other-picture", text, f"{last.match_error_px:.1f} px, and nothing tried makes them fit"),)
        return verdict(REJECTED, reason, causes)
    gone = reach(trace.initial, last.after, trace.stages[0].range)
    if gone.share > FARTHEST_REACH:
        return verdict(REJECTED, f"The LiDAR {gone}.", by_lens())

    doubt = doubt or load_doubt(again is not None)
    wrong = doubt(witnesses(trace, again))
    if wrong < doubt.accepted_below:
        return verdict(ACCEPTED, f"Picture and scan fit together (match error {last.match_error_px:.1f} px).")
    reason = f"Picture and scan fit, but not as well as in runs that end right (an error is {wrong:.0%} likely)."
    return verdict(REJECTED if wrong > doubt.rejected_above else CANNOT_TELL, reason, by_lens())


def _because(reason: str, causes: tuple[Cause, ...]) -> str:
    """The reason, and the likeliest cause."""
    return f"{reason} {causes[0].text}" if causes else reason
