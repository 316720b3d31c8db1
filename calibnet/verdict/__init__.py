"""Is a calibration good, and if not, why not?"""

from calibnet.verdict.causes import match_error_of, misfit_of
from calibnet.verdict.judge import judge
from calibnet.verdict.verdict import ACCEPTED, CANNOT_TELL, CAUSES, REJECTED, Cause, SkippedFrame, Verdict, Word

__all__ = [
    "ACCEPTED",
    "CANNOT_TELL",
    "CAUSES",
    "REJECTED",
    "Cause",
    "SkippedFrame",
    "Verdict",
    "Word",
    "judge",
    "match_error_of",
    "misfit_of",
]
