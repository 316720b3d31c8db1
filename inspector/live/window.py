"""Records a session for Rerun's own window: a large image that follows the pose, and the details of every try."""

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
from inspector.record.tabs.views import View, frame_view, point_legend, with_legend

AT_ONCE = Contents(frozenset({Part.OVERLAYS}), dense=True)
"""Parts of an answer that are shown before its details."""
NO_ANSWER = (
    "# No answer yet\n\nFrame {}. Move the pose with the keys; release them, or press Enter, to run the cascade."
)
KEYS = "keys"
"""Entity of the list of keys."""


class Picture:
    """The first tab: points under the pose or, on the last step of a try, under its result, and the result in words.

    Attributes:
        NAME: title of the tab.
    """

    NAME = "Try"

    def __init__(self, keys: str) -> None:
        """Set the list of keys, as Markdown."""
        self._keys = keys

    def wanted(self, layout: Layout) -> bool:
        """Always."""
        return True

    def log_once(self, rec: Subtree, layout: Layout) -> None:
        """Log the legend of the points' colours, and the keys."""
        log_point_legend(rec, layout.contents.color)
        rec.log_once(KEYS, rr.TextDocument(self._keys, media_type=rr.MediaType.MARKDOWN))

    def log(self, rec: Subtree, observation: Observation, contents: Contents) -> None:
        """Log nothing, since what it shows is logged before the details."""

    def view(self, layout: Layout) -> View:
        """The large image, and the text beside it."""
        picture = frame_view(layout, "Pose, each stage, reference and result", entities.OVERLAY_CURRENT)
        words = rrb.Vertical(
            rrb.TextDocumentView(origin=entities.TABLE, name="Newest answer"),
            rrb.TextDocumentView(origin=KEYS, name="Keys of the terminal"),
        )
        return rrb.Horizontal(
            with_legend(picture, point_legend(layout), "Picture"), words, column_shares=[0.64, 0.36], name=self.NAME
        )


class WindowRecording(TryRecording):
    """Sends everything to a running viewer."""

    def __init__(self, sink: Any, keys: str) -> None:
        """Connect; the window is empty until the first `hold`.

        Args:
            sink: Rerun's sink for the viewer's address or a file.
            keys: list of keys, as Markdown.
        """
        picture = Picture(keys)
        super().__init__((picture, *TABS))
        self._stream.set_sinks(sink)
        self._picture = picture
        self._hand = TrySubtree(self._stream)  # a separate one, since the pose changes while a try is recorded
        self._shown: Frame | None = None

    def hold(self, number: int, frame: Frame, extrinsic: Extrinsic, reference: Extrinsic | None) -> None:
        """Show the points of a frame under the current pose.

        Args:
            number: number of the next try.
            frame: the current frame.
            extrinsic: ``camera_from_lidar`` of the pose.
            reference: the true ``camera_from_lidar``; None if unknown.
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
        """Show the overlays and the table of a try, which take a tenth of the time of the details."""
        self._rec.number = made.number
        log_frame(self._rec, observation, AT_ONCE)
        cascade.log(self._rec, observation, AT_ONCE)
        self._keep()

    def _keep(self) -> None:
        self._stream.flush()
