"""Flushes a recording to its files and viewers, which may no longer accept it."""

from __future__ import annotations

import rerun as rr

from calibnet.errors import CalibnetError

FLUSH_TIMEOUT_S = 60.0
OF_THE_FILE = ("timed out", "File-writer thread")
"""What Rerun's errors say if a file's writer has failed: it no longer answers, or it was seen to end. Others are of a
viewer."""

LOST: list[rr.RecordingStream] = []
"""Recordings whose writer has given up, kept for good: Rerun waits for it for ever where one of them is let go, and at
the interpreter's end, so that a process with one has to end at once."""


class RecordingLostError(CalibnetError):
    """Nothing can be written any more; the recording is among those in `LOST`."""


def flush(rec: rr.RecordingStream) -> None:
    """Flush all rows to the sinks.

    Raises:
        RecordingLostError: the file's writer has failed, for instance because of a quota.
        RuntimeError: a viewer has closed.
    """
    try:
        rec.flush(timeout_sec=FLUSH_TIMEOUT_S)
    except RuntimeError as error:
        if not any(words in str(error) for words in OF_THE_FILE):
            raise
        LOST.append(rec)
        raise RecordingLostError(
            "The recording can no longer be written: the disk or a quota is full, or a viewer does not respond."
        ) from None
