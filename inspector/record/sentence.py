"""The recording of a run that has none, because it failed: why, as a text, and the same as properties."""

from __future__ import annotations

from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb

from calibnet.runtime.claim import Claim
from calibnet.runtime.text import one_line
from calibnet.runtime.writing import Kind
from inspector import entities
from inspector.record.recording import RunDescription
from inspector.record.stream import Stream, plain

SENTENCE = "sentence"
"""Text: why there is no more."""


def record_sentence(file: Path, description: RunDescription, word: str, cause: str, sentence: str) -> None:
    """Write a recording of a run that has none, because it failed: its properties, and why as a text.

    Raises:
        OutputError: the file may not be written.
    """
    claim = Claim(file, Kind.RECORDING)
    try:
        view = rrb.TextDocumentView(origin=SENTENCE, name="Why there is no more")
        layout = rrb.Blueprint(view, rrb.TimePanel(state="hidden"), auto_views=False, auto_layout=False)
        sinks = [rr.FileSink(claim.begin())]
        stream = Stream(entities.APPLICATION_ID, description.recording_id, description.title, sinks, layout)
        stream.rec.send_property(entities.RUN, rr.AnyValues(**plain(description.options)))
        stream.rec.send_property(entities.OUTCOME, rr.AnyValues(word=word, cause=cause, reason=one_line(sentence)))
        stream.rec.log(SENTENCE, rr.TextDocument(f"# {word.capitalize()}\n\n{one_line(sentence)}"), static=True)
        stream.close()
        claim.complete()
    finally:
        claim.release()
