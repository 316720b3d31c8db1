"""A Rerun recording of a calibration run: opened with its first frame, closed with a footer.

The same input and seed give the same data, in the same chunks (``rerun rrd compare --unordered``): no wall-clock
timeline, an id made from the run's options. Every frame is flushed to the file when it is logged, so that memory stays
bounded and a killed run keeps all frames but the current one.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import rerun as rr

from calibnet.datasets.frame import Frame
from calibnet.geometry.types import Extrinsic
from calibnet.runtime.memory import hand_back
from calibnet.trace import CascadeTrace, DriveEstimate
from calibnet.verdict import BadFrame, Verdict
from calibnet.watch import Watched
from inspector import entities
from inspector.mount_changes import sentences
from inspector.record.frame import log_frame, verdict_values
from inspector.record.observation import Layout, Observation
from inspector.record.outcome import outcome_values
from inspector.record.stream import Stream, plain
from inspector.record.subtree import Subtree
from inspector.record.tabs import overview
from inspector.record.tabs.blueprint import make_blueprint
from inspector.record.tabs.drive import log_drive, log_drive_overlay
from inspector.record.tabs.registry import wanted_tabs
from inspector.record.tabs.watch import log_watch

HANDED_BACK_EVERY = 16
"""Number of frames after which free memory is returned to the system."""


@dataclass(frozen=True)
class RunDescription:
    """The identity of a run.

    Attributes:
        title: title in the viewer's list of recordings, for instance ``"kitti-odometry/04"``.
        options: all options that affect the data, such as seed, range and preset.
        provenance: further information, such as versions, which is not part of the identity.
        joins: application and recording id of a recording that this one becomes part of; None for its own.
    """

    title: str
    options: dict[str, Any]
    provenance: dict[str, Any] = field(default_factory=dict)
    joins: tuple[str, str] | None = None

    @property
    def application_id(self) -> str:
        """Ours, or that of the recording that it joins."""
        return self.joins[0] if self.joins else entities.APPLICATION_ID

    @property
    def recording_id(self) -> str:
        """An id that depends only on title and options, or that of the recording that it joins."""
        if self.joins:
            return self.joins[1]
        text = repr((self.title, sorted(self.options.items())))
        return hashlib.sha256(text.encode()).hexdigest()[:16]


class Recording:
    """Logs observations to files and viewers; a context manager that closes properly."""

    def __init__(self, sinks: Sequence[Any], description: RunDescription, layout: Layout) -> None:
        """Open the sinks and log what applies to the whole recording: title, properties, layout and legends.

        Args:
            sinks: files and Rerun sinks, see `inspector.record.outputs`.
            description: identity of the run.
            layout: content of the recording.
        """
        self._layout, self._contents = layout, layout.contents
        self._tabs = wanted_tabs(layout)
        self._seconds: dict[int, float] = {}
        self._flushed = 0
        self._worst = -math.inf
        blueprint = make_blueprint(layout, self._tabs)
        self._stream = Stream(description.application_id, description.recording_id, description.title, sinks, blueprint)
        self._stream.rec.send_property(entities.RUN, rr.AnyValues(**plain(description.options)))
        provenance = rr.AnyValues(**description.provenance, **_described(layout))
        self._stream.rec.send_property(entities.PROVENANCE, provenance)
        self._rec = Subtree(self._stream.rec)
        for tab in self._tabs:
            tab.log_once(self._rec, layout)
        self._stream.flush()  # so that a recording that is cut off anywhere later can still be read

    def log(self, observation: Observation) -> None:
        """Log everything about one frame and flush it to the sinks."""
        self._seconds[observation.frame.index] = observation.frame.timestamp
        log_frame(self._rec, observation, self._contents)
        for tab in self._tabs:
            tab.log(self._rec, observation, self._contents)
        if self._layout.with_worst and observation.badness > self._worst:
            self._worst = observation.badness
            overview.log_worst(self._rec, observation, self._contents)
        self._flush_frame()

    def log_skipped(self, frames: Iterable[BadFrame]) -> None:
        """Log the reasons why frames could not be used; nothing else is logged of these frames."""
        for bad in frames:
            self._rec.set_frame(bad.frame, self._seconds.get(bad.frame, 0.0))
            self._rec.log(entities.SKIPPED, rr.TextLog(bad.why, level=rr.TextLogLevel.WARN))
        self._stream.flush()

    def log_given(self, verdict: Verdict) -> None:
        """Log the verdict on the calibration that the run started from."""
        self._rec.log_once(entities.VERDICT_GIVEN, verdict_values(verdict))
        self._stream.flush()

    def log_outcome(self, verdict: Verdict, reference: Extrinsic | None = None) -> None:
        """Set properties with the run's verdict and, with a reference, the error of its result."""
        self._stream.rec.send_property(entities.OUTCOME, outcome_values(verdict, reference))

    def log_drive(
        self,
        estimate: DriveEstimate,
        reference: Extrinsic | None,
        given: Verdict | None = None,
        remarks: Sequence[str] = (),
    ) -> None:
        """Log the drive's extrinsic, the verdict on the given one, and remarks."""
        if estimate.verdict is not None:
            self._rec.log_once(entities.VERDICT_DRIVE, verdict_values(estimate.verdict))
        if math.isfinite(self._worst):
            remarks = [*remarks, f"*{overview.WORST}*, above the picture of *{overview.NAME}*, shows that one."]
        log_drive(self._rec, estimate, reference, self._seconds, given, remarks)
        self._stream.flush()

    def log_no_drive(self, why: Sequence[str]) -> None:
        """Log why the drive is not solved, in the place of its result."""
        text = "\n\n".join(["# Not solved", *why])
        self._rec.log_for_all(entities.DRIVE_TEXT, rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN))
        self._stream.flush()

    def log_watch(self, watched: Watched) -> None:
        """Log whether the mount moved, if there is a tab for it."""
        if self._layout.with_watch:
            to_frame = lambda frame: self._rec.set_frame(frame, self._seconds.get(frame, 0.0))  # noqa: E731
            log_watch(self._rec, watched.watch, list(sentences(watched)), to_frame)

    def log_drive_overlay(
        self, frame: Frame, estimate: DriveEstimate, reference: Extrinsic | None, given: Verdict | None = None
    ) -> None:
        """Log a frame's points under the drive's extrinsic; nothing for a frame that is not recorded."""
        if frame.index not in self._seconds:
            return
        observation = Observation(frame, CascadeTrace(estimate.camera_from_lidar, ()), reference, given=given)
        log_drive_overlay(self._rec, observation, self._contents, estimate.verdict)
        self._flush_frame()

    def close(self, advance: Callable[[int, int], bool] | None = None) -> str:
        """Flush and write the footer; does nothing if the recording can no longer be written.

        Args:
            advance: see `inspector.record.indexing.index`.

        Returns:
            A note for the user on how the recording was closed; empty for none.
        """
        self._stream.close(advance)
        return self._stream.remark

    def _flush_frame(self) -> None:
        """Flush a frame to the sinks and, now and then, return free memory to the system."""
        self._stream.flush()
        self._flushed += 1
        if self._flushed % HANDED_BACK_EVERY == 0:
            hand_back()

    def __enter__(self) -> Recording:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _described(layout: Layout) -> dict[str, Any]:
    """Properties on the content of the recording, for readers without a layout.

    Names differ from those of options, since Rerun allows one type per name in a process.
    """
    return {
        "stage_numbers": [stage.number for stage in layout.stages],
        "stage_ranges": [stage.range for stage in layout.stages],
        "has_reference": layout.has_reference,
    }
