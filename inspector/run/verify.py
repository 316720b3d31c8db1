"""Judges the calibration that a session starts from, with a recording or without."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from calibnet.calibrator import DriveCalibrator
from calibnet.datasets.frame import Frame
from calibnet.datasets.selection import PickedFrames
from calibnet.errors import CalibrationError, DatasetError
from calibnet.geometry.types import Extrinsic
from calibnet.judging.verify import DRIVE, FRAME, named_cause, unfit
from calibnet.runtime.interruption import StopRequest
from calibnet.verdict import Verdict
from inspector.run.initial_verdict import judge_initial, suspected
from inspector.run.progress import drive_observer, frame_progress
from inspector.run.session import STOPPING, Session
from inspector.run.summary import Summary

UNKNOWN = np.full((4, 4), np.nan)
"""Extrinsic of a verdict on input that cannot be made into a frame."""


@dataclass(frozen=True)
class Readable:
    """Frames that remember which of them could not be read."""

    frames: PickedFrames
    stop: bool = False
    unread: dict[int, str] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.frames)

    def index_of(self, position: int) -> int:
        """The number of a frame."""
        return self.frames.index_of(position)

    def __getitem__(self, position: int) -> Frame:
        """Read a frame, and note a failure; input that is read but cannot be right counts as read."""
        try:
            return self.frames[position]
        except DatasetError as error:
            if not named_cause(error):
                self.unread[self.index_of(position)] = str(error)
            raise

    def first(self) -> Frame:
        """The first frame that can be read.

        Raises:
            DatasetError: half of them or more cannot.
        """
        for position in range(len(self)):
            try:
                return self[position]
            except DatasetError as error:
                if named_cause(error):
                    raise
                self.check()
        raise AssertionError("without frames there is nothing to read")

    def check(self) -> None:
        """Check that enough frames could be read.

        Raises:
            DatasetError: half of them or more could not, or one where ``stop`` is set.
        """
        if not self.unread or not (self.stop or 2 * len(self.unread) >= len(self)):
            return
        each = " ".join(f"Frame {frame}: {why}" for frame, why in self.unread.items())
        share = "" if self.stop else ", which is at least half"
        raise DatasetError(f"{len(self.unread)} of {len(self)} frames cannot be read{share}. {each}")


@dataclass(frozen=True, eq=False)
class Verified:
    """What came of judging a calibration.

    Attributes:
        verdict: on it.
        given: the calibration that was judged, 4x4; `UNKNOWN` where the input cannot even be made into a frame.
        summary: of a recorded run; None where nothing was recorded.
    """

    verdict: Verdict
    given: Extrinsic = field(repr=False)
    summary: Summary | None = None


def verify_session(session: Session, record: bool) -> Verified:
    """Judge the calibration that a session starts from, by its only frame or by the drive.

    Args:
        session: the session, with ``verify`` set.
        record: whether to run it in full and record it; otherwise only what the verdict needs is computed.

    Raises:
        DatasetError: half of the frames or more cannot be read.
        KeyboardInterrupt: the run was interrupted before there was a verdict.
    """
    frames = Readable(session.frames, session.stop_on_bad_frame)
    given, summary = UNKNOWN, None
    try:
        given = session.start.initial(frames.first())
        if not record:
            return Verified(_judge(session, frames, given), given)
        summary = session.run()
        if summary.given_verdict is None:
            raise KeyboardInterrupt
        return Verified(summary.given_verdict, given, summary)
    except (CalibrationError, DatasetError) as error:
        causes = named_cause(error)
        if not causes:
            frames.check()
            if record and isinstance(error, DatasetError):
                raise
        causes = causes or suspected(session.cascade, frames, given)
        return Verified(unfit(given, str(error), causes), given, summary)


def as_json(verdict: Verdict) -> dict[str, object]:
    """The verdict's JSON object, with null for an unknown extrinsic."""
    content = verdict.as_dict()
    return content if np.isfinite(verdict.camera_from_lidar).all() else content | {"camera_from_lidar": None}


def _judge(session: Session, frames: Readable, given: Extrinsic) -> Verdict:
    if len(frames) == 1:
        found, standard = session.cascade.calibrate(frames[0], given).verdict, FRAME
    else:
        with StopRequest(STOPPING) as stop, frame_progress(session.console) as progress:
            observer = drive_observer(progress, stop)
            assert isinstance(session.cascade, DriveCalibrator), "the cascade is what verifies"
            found, standard = session.cascade.calibrate_drive(frames, given, observer).verdict, DRIVE
        frames.check()
    assert found is not None, "the cascade judges what it finds"
    return judge_initial(session.cascade, frames, given, found, standard)
