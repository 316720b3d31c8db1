"""Traces with the verdict that a test wants."""

from __future__ import annotations

from dataclasses import replace

from calibnet.trace import CascadeTrace
from calibnet.verdict import ACCEPTED, CANNOT_TELL, REJECTED, Cause, Verdict, moved

REASON = "Image and scan do not fit together."
UNSURE = "Image and scan fit, but not well."


def judged(
    trace: CascadeTrace, rejected: bool = False, causes: tuple[Cause, ...] = (), unsure: bool = False
) -> CascadeTrace:
    word, reason = (REJECTED, REASON) if rejected else (ACCEPTED, "Image and scan fit together.")
    if unsure:
        word, reason = CANNOT_TELL, UNSURE
    verdict = Verdict(word, reason, trace.arrived, moved(trace.initial, trace.arrived), causes)
    return replace(trace, verdict=verdict)
