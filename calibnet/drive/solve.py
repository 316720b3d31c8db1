"""Solves one extrinsic from all frames of a drive: first by the stages of the cascade, then by aligning edges."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple, Protocol

from calibnet.alignment import Evidence, gather
from calibnet.datasets.frame import Frame, Frames, index_of
from calibnet.datasets.plausibility import suspicion
from calibnet.datasets.selection import evenly_spaced
from calibnet.drive.consensus import Consensus
from calibnet.drive.convergence import Convergence, Due
from calibnet.drive.moving import Moving
from calibnet.drive.readings import Observed, Readings
from calibnet.errors import CalibnetError, CalibrationError, DatasetError
from calibnet.geometry import MiscalibrationRange, is_finest
from calibnet.geometry.prior import PosePrior
from calibnet.geometry.se3 import pose_vector
from calibnet.geometry.types import Extrinsic, Matrix6
from calibnet.judging.drive_lens import lens_reading
from calibnet.trace import DriveEstimate, DriveLook, Estimate, StageTrace
from calibnet.verdict import BadFrame

FRAMES_UNTIL_LAST_LOOK = 24
"""Number of frames, spread over the drive, used in all looks but the last."""
LOOKS = 2
"""Number of looks of each stage at a drive, each on scans projected anew; the last stage has one more, at all
frames."""
FRAMES_ALIGNED = 24
"""Number of frames, spread over the drive, whose edges are aligned; each takes 4 MB until the end."""


class DriveStage(Protocol):
    """The part of `calibnet.cascade.Stage` that a drive needs."""

    @property
    def range(self) -> MiscalibrationRange:
        """Range that its network was trained for."""
        ...

    @property
    def match_error_limit_px(self) -> float:
        """Largest match error at which it is believed, in pixels of its image."""
        ...

    def view(self, frame: Frame) -> Any:
        """The frame's image as the stage sees it."""
        ...

    def look(self, frame: Frame, view: Any, before: Extrinsic) -> StageTrace:
        """Correct an extrinsic once."""
        ...


def solve_drive(
    stages: Sequence[DriveStage],
    frames: Frames,
    initial: Extrinsic,
    common_error: Matrix6,
    observer: Callable[[int, int], None] | None = None,
    pose_prior: PosePrior | None = None,
) -> DriveEstimate:
    """Correct the extrinsic that all frames share.

    Each stage looks at some frames spread over the drive, their consensus corrects the extrinsic, and this is repeated
    on the scans projected anew; the last look is at all frames. After the finest stage, edges and reflectance of some
    frames are aligned (`calibnet.alignment`), which corrects a few pixels at most. If the car moves, what the motion in
    the images shows (`calibnet.motion`) is added for the verdict. Only two frames are in memory at a
    time, besides 4 MB of each aligned frame.

    Args:
        stages: coarse to fine.
        frames: frames of one camera and LiDAR on one mount; each is read in the last look, and some before.
        initial: ``camera_from_lidar`` to start from.
        common_error: covariance of the error that the networks make in all frames.
        observer: called before each frame is read and at the end, with how many are read so far, and in all.
        pose_prior: prior on the extrinsic.

    Raises:
        CalibrationError: no frame could be calibrated.
        DatasetError: no frame could be read.
        ValueError: there are no frames.
    """
    if not len(frames):
        raise ValueError("There are no frames to calibrate.")
    some = evenly_spaced(len(frames), FRAMES_UNTIL_LAST_LOOK)
    readings = Readings(observer, LOOKS * len(stages) * len(some) + len(frames))
    observed = Observed(frames, readings)
    extrinsic = initial
    for stage in stages:
        for _ in range(LOOKS):
            looks = DriveLooks(stage, observed, some, extrinsic)
            extrinsic = agree(looks, pose_prior, common_error).estimate().camera_from_lidar

    aligns = is_finest(stages[-1].range)
    evidence, last_looks = list[Evidence](), list[DriveLook]()
    to_align, convergence = Due(evenly_spaced(len(frames), FRAMES_ALIGNED)), Convergence(len(frames))
    consensus = Consensus(extrinsic, stages[-1].range, pose_prior, common_error)
    moving = Moving(extrinsic, len(frames))

    def estimate(*starts: Estimate) -> Estimate:
        return consensus.aligned(evidence, starts) if aligns else consensus.estimate()

    looks = DriveLooks(stages[-1], observed, range(len(frames)), extrinsic)
    for position, frame, trace in looks:
        consensus.add(trace.correction, trace.information)
        last_looks.append(drive_look(frame, position, trace))
        if aligns and to_align.reached(position):
            evidence.append(gather(frame, extrinsic))
        if aligns:
            moving.note(position, frame)
        convergence.note(position, frame.index, lambda: estimate(*convergence.latest))
    of_networks = consensus.estimate()
    final = estimate(of_networks, *convergence.latest)
    convergence.end(final)
    readings.end()
    return DriveEstimate(
        final.camera_from_lidar,
        final.covariance,
        final.frames,
        tuple(convergence.points),
        skipped=tuple(looks.skipped),
        networks=of_networks if aligns else None,
        looks=tuple(last_looks),
        looked_from=extrinsic,
        motion=moving.estimate(final.camera_from_lidar),
    )


def drive_look(frame: Frame, position: int, look: StageTrace) -> DriveLook:
    """The result of one look at one frame, as kept for the drive."""
    offset, error_px = pose_vector(look.correction), look.match_error_px
    in_image = look.in_image(error_px, frame.camera)
    return DriveLook(frame.index, position, offset, look.information, error_px, lens_reading(look), in_image)


class FrameLook(NamedTuple):
    """A look at the frame at a position of a drive."""

    position: int
    frame: Frame
    trace: StageTrace


class DriveLooks:
    """One look of a stage at each of some frames of a drive, made during iteration so that one frame is in memory.

    Attributes:
        skipped: frames that could not be read or calibrated so far.
    """

    def __init__(self, stage: DriveStage, frames: Frames, positions: Sequence[int], extrinsic: Extrinsic) -> None:
        """Look with ``stage`` at the frames at ``positions``, under ``extrinsic``."""
        self.stage, self.frames, self.positions, self.extrinsic = stage, frames, positions, extrinsic
        self.skipped = list[BadFrame]()

    def __iter__(self) -> Iterator[FrameLook]:
        """Iterate over the looks at frames that can be calibrated.

        Raises:
            CalibrationError: none could be calibrated.
            DatasetError: none could be read.
        """
        failure: CalibnetError | None = None
        for position in self.positions:
            number = index_of(self.frames, position)
            try:
                frame = self.frames[position]
                number = frame.index
                trace = self.stage.look(frame, self.stage.view(frame), self.extrinsic)
                trace = require_match(trace, self.stage.match_error_limit_px, frame)
            except (CalibrationError, DatasetError) as error:
                failure = error
                self.skipped.append(BadFrame(number, str(error)))
                continue
            yield FrameLook(position, frame, trace)
        if failure is not None and len(self.skipped) == len(self.positions):
            raise failure


def agree(looks: DriveLooks, pose_prior: PosePrior | None = None, common_error: Matrix6 | None = None) -> Consensus:
    """The consensus of looks; arguments as for `Consensus`.

    Raises:
        CalibrationError: no frame could be calibrated.
        DatasetError: none could be read.
    """
    consensus = Consensus(looks.extrinsic, looks.stage.range, pose_prior, common_error)
    for look in looks:
        consensus.add(look.trace.correction, look.trace.information)
    return consensus


def require_match(look: StageTrace, limit_px: float, frame: Frame) -> StageTrace:
    """The look, if its match error is within the limit.

    Raises:
        CalibrationError: it is not.
    """
    if look.match_error_px > limit_px:
        usual = "check that they belong together and that the start is within the range of the first stage"
        raise CalibrationError(
            f"Image and scan of frame {frame.index} ({frame.source}) do not fit together after stage {look.number}, "
            f"which expects its matches to be {look.in_image(look.match_error_px, frame.camera):.1f} px off "
            f"(at most {look.in_image(limit_px, frame.camera):.1f}): "
            f"{suspicion(frame.remarks, usual)}."
        )
    return look
