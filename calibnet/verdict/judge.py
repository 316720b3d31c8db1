"""The verdict on a calibrated frame, and on a drive."""

from __future__ import annotations

from calibnet.geometry import MiscalibrationRange, invert
from calibnet.geometry.types import Extrinsic
from calibnet.trace import CascadeTrace, DriveEstimate
from calibnet.verdict.verdict import ACCEPTED, REJECTED, Verdict, moved


def judge(trace: CascadeTrace) -> Verdict:
    """Whether what the stages found on one frame is good."""
    last = trace.stages[-1]
    word, reason = ACCEPTED, "Picture and scan fit together."
    if not trace.fits:
        word, reason = (
            REJECTED,
            (
                f"Picture and scan do not fit together after stage {last.number}, which expects its matches to be "
                f"{last.match_error_px:.1f} px off (at most {trace.match_error_limit_px:g})."
            ),
        )
    elif not trace.stayed:
        assert trace.searched is not None
        turned, shifted = moved(trace.initial, trace.arrived)
        word, reason = (
            REJECTED,
            (
                f"It moved by {turned:.2g}° and {shifted:.0f} cm, out of the range that was searched, "
                f"{trace.searched.label}."
            ),
        )
    return Verdict(word, reason, trace.arrived, moved(trace.initial, trace.arrived))


def judge_drive(estimate: DriveEstimate, initial: Extrinsic, searched: MiscalibrationRange, margin: float) -> Verdict:
    """Whether the extrinsic that was solved from a drive is good."""
    there, skipped = estimate.camera_from_lidar, estimate.skipped
    turned, shifted = moved(initial, there)
    word, reason = ACCEPTED, f"{estimate.frames} frames agree."
    if not searched.contains(there @ invert(initial), margin):
        word, reason = (
            REJECTED,
            (f"It moved by {turned:.2g}° and {shifted:.0f} cm, out of the range that was searched, {searched.label}."),
        )
    return Verdict(word, reason, there, (turned, shifted), (), estimate.covariance, estimate.frames, skipped)
