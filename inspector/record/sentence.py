"""Records a failed run: a recording with the reason, as a text and as properties."""

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


def record_sentence(file: Path, description: RunDescription, word: str, cause: str, sentence: str) -> None:
    """Write the recording of a failed run: its properties, and the reason as a text.

    Raises:
        OutputError: the file must not be written.
    """
    claim = Claim(file, Kind.RECORDING)
    try:
        view = rrb.TextDocumentView(origin=entities.FAILURE, name="Why it failed")
        layout = rrb.Blueprint(view, rrb.TimePanel(state="hidden"), auto_views=False, auto_layout=False)
        title = description.title
        stream = Stream(entities.APPLICATION_ID, description.recording_id, title, [claim.begin()], layout)
        stream.rec.send_property(entities.RUN, rr.AnyValues(**plain(description.options)))
        stream.rec.send_property(entities.OUTCOME, rr.AnyValues(word=word, cause=cause, reason=one_line(sentence)))
        stream.rec.log(entities.FAILURE, rr.TextDocument(f"# {word.capitalize()}\n\n{one_line(sentence)}"), static=True)
        stream.close()
        claim.complete()
    finally:
        claim.release()
