"""The recording of a session with Rerun's own window: the large picture follows the pose, and every try its details."""

from __future__ import annotations

from typing import Any

import rerun as rr
import rerun.blueprint as rrb

from calibnet.datasets.frame import Frame
from calibnet.geometry.types import Extrinsic
from calibnet.trace import CascadeTrace
from inspector import entities
from inspector.live.stream import CONTENTS, TABS, TIMELINE, TryRecording, TrySubtree
from inspector.live.tries import Try
from inspector.record.contents import Contents, Part
from inspector.record.frame import log_frame, log_image
from inspector.record.observation import Layout, Observation
from inspector.record.pictures.frame_overlays import FrameOverlays
from inspector.record.pictures.legends import log_point_legend
from inspector.record.subtree import Subtree
from inspector.record.tabs import cascade
from inspector.record.tabs.blueprint import make_blueprint
from inspector.record.tabs.views import View, overlay_view, point_legend, with_legend

AT_ONCE = Contents(frozenset({Part.OVERLAYS}), dense=True)
"""What is shown of an answer before its details."""
NO_ANSWER = (
    "# No answer yet\n\nFrame {}. Turn it with the keys and let go, or press Enter: the answer comes from there."
)
KEYS = "keys"
"""What the keys of the terminal do, as text."""


class Picture:
    """The tab in front: the points under the pose, on the last step of a try its result, and in words what came of it.

    Attributes:
        NAME: its title.
    """

    NAME = "Try"

    def __init__(self, keys: str) -> None:
        """Say in Markdown what the keys do."""
        self._keys = keys

    def wanted(self, layout: Layout) -> bool:
        """Always."""
        return True

    def log_once(self, rec: Subtree, layout: Layout) -> None:
        """Log what the points' colours stand for, and the keys."""
        log_point_legend(rec, layout.contents.color)
        rec.log_once(KEYS, rr.TextDocument(self._keys, media_type=rr.MediaType.MARKDOWN))

    def log(self, rec: Subtree, observation: Observation, contents: Contents) -> None:
        """Log nothing: what it shows is there before the details."""

    def view(self, layout: Layout) -> View:
        """The large picture, and beside it the words."""
        picture = overlay_view(
            "The pose, then each stage, the truth and the result", entities.OVERLAY_CURRENT, layout.image
        )
        words = rrb.Vertical(
            rrb.TextDocumentView(origin=entities.TABLE, name="The newest answer"),
            rrb.TextDocumentView(origin=KEYS, name="Keys of the terminal"),
        )
        return rrb.Horizontal(
            with_legend(picture, point_legend(layout), "Picture"), words, column_shares=[0.7, 0.3], name=self.NAME
        )


class WindowRecording(TryRecording):
    """Sends everything to a viewer that runs."""

    def __init__(self, sink: Any, keys: str) -> None:
        """Connect; the window shows something with the first `hold`.

        Args:
            sink: of Rerun, the viewer's address or a file.
            keys: what they do, as Markdown.
        """
        picture = Picture(keys)
        super().__init__((picture, *TABS))
        self._stream.set_sinks(sink)
        self._picture = picture
        self._hand = TrySubtree(self._stream)  # its own, as the hand moves on while a try is recorded beside it
        self._shown: Frame | None = None

    def hold(self, number: int, frame: Frame, extrinsic: Extrinsic, reference: Extrinsic | None) -> None:
        """Show the points of a frame under the pose under the hand.

        Args:
            number: that the next try will have.
            frame: at hand.
            extrinsic: ``camera_from_lidar`` of the pose.
            reference: the true one, where it is known.
        """
        observation = Observation(frame, CascadeTrace(extrinsic, ()), reference)
        self._hand.number = number
        self._hand.set_frame(frame.index, 0.0)
        if self._shown is None:
            layout = Layout.of(observation, CONTENTS)
            self._stream.send_blueprint(make_blueprint(layout, [self._picture], timeline=TIMELINE, following=True))
            self._stream.send_recording_name("live")
            self._picture.log_once(self._hand, layout)
        if frame is not self._shown:
            log_image(self._hand, frame)
            words = rr.TextDocument(NO_ANSWER.format(frame.index), media_type=rr.MediaType.MARKDOWN)
            self._hand.log(entities.TABLE, words)
            self._shown = frame
        FrameOverlays(observation, AT_ONCE).log(self._hand, entities.OVERLAY_CURRENT, "mine", extrinsic)
        self._keep()

    def answer(self, made: Try, observation: Observation) -> None:
        """Show the overlays of a try and its table; they take a tenth of what the details take."""
        self._rec.number = made.number
        log_frame(self._rec, observation, AT_ONCE)
        cascade.log(self._rec, observation, AT_ONCE)
        self._keep()

    def _keep(self) -> None:
        self._stream.flush()
