"""What Rerun says when it cannot flush: whether the file is lost, or only a viewer."""

from __future__ import annotations

from typing import Any

import pytest

from inspector.record import flushing


class Failing:
    """A stream of Rerun's that cannot be flushed."""

    def __init__(self, words: str) -> None:
        self.words = words

    def flush(self, timeout_sec: float) -> None:
        raise RuntimeError(self.words)


@pytest.mark.parametrize(
    "words", ["Flush timed out - not all log messages were sent", "File-writer thread shut down prematurely"]
)
def test_a_file_whose_writer_has_failed_is_lost(words: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Rerun says either, as it happens; the second was taken for a viewer that closed, and the run went on."""
    monkeypatch.setattr(flushing, "LOST", [])
    stream: Any = Failing(words)
    with pytest.raises(flushing.RecordingLostError, match="can no longer be written"):
        flushing.flush(stream)
    assert [stream] == flushing.LOST


def test_a_viewer_that_closed_is_no_loss() -> None:
    stream: Any = Failing("the connection was closed")
    with pytest.raises(RuntimeError, match="connection"):
        flushing.flush(stream)
