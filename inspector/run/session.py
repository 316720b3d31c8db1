"""The main loop of a run: reads frames, calibrates them and records the result, with progress."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from collections.abc import Sequence as Positions
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from rich.console import Console
from rich.progress import Progress

from calibnet.calibrator import Calibrator, DriveCalibrator, drives_only, with_causes
from calibnet.datasets.frame import Frame, Sequence, index_of
from calibnet.datasets.selection import PickedFrames
from calibnet.errors import CalibnetError, CalibrationError, DatasetError
from calibnet.geometry.types import Extrinsic
from calibnet.judging.lag import lags
from calibnet.judging.verify import DRIVE, FRAME, named_cause, unfit, verify
from calibnet.runtime.interruption import StopRequest
from calibnet.trace import DriveEstimate
from calibnet.verdict import REJECTED, BadFrame, Verdict
from calibnet.watch import Watched
from inspector.record.contents import Contents
from inspector.record.observation import Layout, Observation, Skipped
from inspector.record.outputs import Outputs
from inspector.record.recording import Recording, RunDescription
from inspector.record.tabs.drive import drive_sentence
from inspector.run.initial_verdict import judge_initial, suspected
from inspector.run.precomputed_drive import PrecomputedDrive, first_readable
from inspector.run.progress import drive_observer, frame_progress
from inspector.run.start import Start
from inspector.run.summary import Summary

MOST_EXPLAINED = 1
"""Number of frames in which causes are looked for, as that takes as long as a dozen frames; one mostly suffices."""
INDEX = "index of the recording, MB"
STOPPING = "Stopping after this frame; press Ctrl-C again to stop at once."


@dataclass(frozen=True, kw_only=True)
class Session:
    """Everything that a run needs, and the run itself.

    Attributes:
        sequence: the sequence of frames.
        positions: positions of the frames to run, in order.
        cascade: the cascade, or another method.
        skipped: requested stages that have no weights.
        start: initial extrinsic of each frame.
        outputs: outputs of the recording.
        description: title and properties of the recording.
        contents: what to log of each frame.
        console: console for progress.
        drive: whether to solve the drive's extrinsic from all frames after the single ones, if they share one mount.
        drive_asked: whether the user asked for it, so that a drive which cannot be solved is an error.
        stop_on_bad_frame: whether to end at the first frame that cannot be used.
        verify: whether to judge the calibration that the run starts from, by the only frame or by the drive.
        watching: result of watching the solved drive for moves of the mount; None where there is none.
    """

    sequence: Sequence
    positions: Positions[int]
    cascade: Calibrator
    skipped: Positions[Skipped] = ()
    start: Start
    outputs: Outputs
    description: RunDescription
    contents: Contents
    console: Console
    drive: bool = False
    drive_asked: bool = False
    stop_on_bad_frame: bool = False
    verify: bool = False
    watching: Callable[[DriveEstimate], Watched] | None = None

    @property
    def frames(self) -> PickedFrames:
        """The selected frames."""
        return PickedFrames(self.sequence, self.positions)

    def run(self) -> Summary:
        """Calibrate and record every frame that can be used.

        Returns:
            The summary; `Summary.interrupted` after Ctrl-C or SIGTERM.

        Raises:
            CalibnetError: half of the frames or more cannot be used, one cannot and ``stop_on_bad_frame`` is set, or
                the disk is full. What was recorded is closed properly, and the message says where.
        """
        summary = Summary()
        recording: Recording | None = None
        one_mount = True
        try:
            with StopRequest(STOPPING) as stop, frame_progress(self.console) as progress:
                method = self._method(progress, stop)
                for position in progress.track(self.positions, description=self.sequence.name):
                    if stop.requested:
                        summary.interrupted = True
                        break
                    observation = self._observe(method, position, summary)
                    if observation is None:
                        continue
                    if recording is None:
                        layout = Layout.of(observation, self.contents, self.drive)
                        watched = self.drive and self.watching is not None
                        layout = replace(layout, with_watch=watched, frames=self._range(observation.frame))
                        recording = Recording(self.outputs.open(), self.description, layout)
                        initial, reference = observation.trace.initial, observation.reference
                    one_mount &= bool(np.allclose(observation.trace.initial, initial, atol=1e-9))
                    self.outputs.check_space()
                    recording.log(observation)
                    summary.add(observation)
                    summary.given_verdict = observation.given
                summary.check_enough()
                if recording is not None:
                    recording.log_skipped(summary.skipped)
                    summary.frames_done()
                    if self.drive and not summary.interrupted:
                        if one_mount:
                            self._record_drive(method, recording, summary, initial, reference, progress, stop)
                        else:
                            self._no_drive(recording, summary, "The frames come from several mounts")
                    if summary.given_verdict is not None:
                        recording.log_given(summary.given_verdict)
                    if summary.outcome is not None:
                        recording.log_outcome(summary.outcome, reference)
        except KeyboardInterrupt:
            summary.interrupted = True
        except CalibnetError as error:
            raise type(error)(f"{error}{self._what_is_kept(summary)}") from error
        finally:
            if recording is not None:
                self._close(recording)
        if recording is not None and not summary.interrupted:
            self.outputs.complete()
        return summary

    def _method(self, progress: Progress, stop: StopRequest) -> Calibrator:
        """The method for single frames; one that solves whole drives only solves the drive first."""
        if not drives_only(self.cascade):
            return self.cascade
        assert isinstance(self.cascade, DriveCalibrator)
        initial = self.start.initial(first_readable(self.frames))
        self._show()
        return PrecomputedDrive(self.cascade.calibrate_drive(self.frames, initial, drive_observer(progress, stop)))

    def _show(self) -> None:
        """Open the viewer or the page, and print where it is, once."""
        if self.outputs.show() and self.outputs.page is not None:
            self.console.print(f"Watch it at {self.outputs.page}")

    def _range(self, first: Frame) -> tuple[int, int]:
        """Numbers of the first and the last frame, read from the last frame where the dataset may skip numbers."""
        last = first
        if len(self.positions) > 1:
            with contextlib.suppress(DatasetError):
                last = self.sequence[self.positions[-1]]
        return first.index, last.index

    def _close(self, recording: Recording) -> None:
        """Close the recording, which takes a while for a long one; after Ctrl-C it is complete, but has no index."""
        with StopRequest() as stop, frame_progress(self.console, transient=True) as progress:
            task = progress.add_task(INDEX, total=None)

            def advance(written: int, expected: int) -> bool:
                progress.update(task, completed=written // 1_000_000, total=max(written, expected) // 1_000_000)
                return not stop.requested

            remark = recording.close(advance)
            progress.update(task, total=progress.tasks[0].completed)  # the index may have fewer chunks than expected
        if remark:
            self.console.print(remark, style="yellow")

    def _observe(self, method: Calibrator, position: int, summary: Summary) -> Observation | None:
        """Read and calibrate one frame; None where it cannot be used, which the summary counts."""
        number = index_of(self.sequence, position)
        try:
            frame = self.sequence[position]
            number = frame.index
            self._show()
            initial = self.start.initial(frame)
            trace = method.calibrate(frame, initial, detail=self.contents.inside)
            if trace.verdict is not None and summary.explained < MOST_EXPLAINED:
                beside = partial(lags, self.frames, list(self.positions).index(position))
                verdict = with_causes(self.cascade, frame, initial, trace.verdict, beside)
                summary.explained += verdict is not trace.verdict
                trace = replace(trace, verdict=verdict)
        except (CalibrationError, DatasetError) as error:
            if self.stop_on_bad_frame or len(self.positions) == 1:
                raise
            summary.skipped.append(BadFrame(number, str(error)))
            summary.unread += isinstance(error, DatasetError) and not named_cause(error)
            self.console.print(f"Skipped: {error}", style="yellow")
            return None
        given = None
        if self.verify and not self.drive and trace.verdict is not None:
            given = verify(trace.initial, trace.verdict, FRAME)
        return Observation(frame, trace, self.start.reference(frame), tuple(self.skipped), given)

    def _record_drive(
        self,
        method: Calibrator,
        recording: Recording,
        summary: Summary,
        initial: Extrinsic,
        reference: Extrinsic | None,
        progress: Progress,
        stop: StopRequest,
    ) -> None:
        """Solve the drive's extrinsic from all frames, log its convergence, and print the result."""
        assert isinstance(method, DriveCalibrator), "a drive is solved by a method that can"
        try:
            estimate = method.calibrate_drive(self.frames, initial, drive_observer(progress, stop))
        except CalibrationError as error:
            if not self.verify:
                if self.drive_asked:
                    raise
                self._no_drive(recording, summary, str(error).removesuffix("."))
                return
            summary.given_verdict = unfit(initial, str(error), suspected(self.cascade, self.frames, initial))
            return
        if self.verify and estimate.verdict is not None:
            summary.given_verdict = judge_initial(self.cascade, self.frames, initial, estimate.verdict, DRIVE)
        recording.log_drive(estimate, reference, summary.given_verdict, summary.of_frames())
        if self.watching is not None:
            recording.log_watch(self.watching(estimate))
        self._record_drive_overlays(recording, estimate, summary.given_verdict, stop)
        summary.drive = drive_sentence(estimate, reference, initial)
        summary.drive_verdict = estimate.verdict
        if estimate.verdict is None or estimate.verdict.word != REJECTED:
            summary.found = estimate.camera_from_lidar

    def _no_drive(self, recording: Recording, summary: Summary, why: str) -> None:
        """Note why the drive is not solved, in the summary and in the recording."""
        summary.drive = f"{why}: the whole drive is not solved as one."
        recording.log_no_drive([summary.drive, *summary.of_frames()])

    def _record_drive_overlays(
        self, recording: Recording, estimate: DriveEstimate, given: Verdict | None, stop: StopRequest
    ) -> None:
        """Show the drive's extrinsic on every recorded frame, including those that were left out of the solution."""
        for position in self.positions:
            if stop.requested:
                raise KeyboardInterrupt
            with contextlib.suppress(DatasetError):
                frame = self.sequence[position]
                recording.log_drive_overlay(frame, estimate, self.start.reference(frame), given)

    def _what_is_kept(self, summary: Summary) -> str:
        if summary.frames == 0 or self.outputs.file is None:
            return ""
        kept = (
            f" What was recorded before ({summary.frames} of {len(self.positions)} frames) is in {self.outputs.file}."
        )
        earlier = self.outputs.earlier
        return kept if earlier is None else f"{kept} The earlier recording of that name is kept as {earlier}."
