"""One extrinsic from all frames of a drive: first by the stages of the cascade, then by aligning edges."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from typing import Any, Protocol

from calibnet.alignment import Evidence, gather
from calibnet.datasets.frame import Frame, Frames
from calibnet.datasets.plausibility import suspicion
from calibnet.datasets.selection import evenly_spaced
from calibnet.drive.consensus import Consensus
from calibnet.drive.convergence import Convergence, Due
from calibnet.errors import CalibnetError, CalibrationError, DatasetError
from calibnet.geometry import MiscalibrationRange, is_finest
from calibnet.geometry.prior import PosePrior
from calibnet.geometry.se3 import pose_vector
from calibnet.geometry.types import Extrinsic, Matrix6
from calibnet.trace import DriveEstimate, DriveLook, Estimate, StageTrace
from calibnet.verdict import BadFrame

FRAMES_UNTIL_LAST_LOOK = 24
"""Frames, spread over the drive, that all looks but the last one see."""
LOOKS = 2
"""Looks of each stage at a drive, each on scans projected anew; the last stage takes one more, at all frames."""
FRAMES_ALIGNED = 24
"""Frames, spread over the drive, whose edges are aligned: each keeps 4 MB of pictures until the end."""


class DriveStage(Protocol):
    """What a drive needs of a `calibnet.cascade.Stage`."""

    @property
    def range(self) -> MiscalibrationRange:
        """What its network was trained for."""
        ...

    @property
    def match_error_limit_px(self) -> float:
        """What error it may expect of its matches to be believed."""
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

    Each stage looks at some frames from all over the drive, their consensus corrects the extrinsic, and this is
    repeated on the scans projected anew; the last look is at all frames. After the finest stage, edges and reflectance
    of some frames are aligned (`calibnet.alignment`), which corrects a few pixels at most. One frame is in memory at a
    time, and 4 MB of each that is aligned.

    Args:
        stages: coarse to fine.
        frames: of one camera and LiDAR on one mount; each is read in the last look, and some before.
        initial: ``camera_from_lidar`` to start from.
        common_error: covariance of what the networks get wrong in all frames alike.
        observer: called before each frame is read and at the end, with how many are read so far, and in all.
        pose_prior: what is known of the extrinsic beforehand.

    Raises:
        CalibrationError: no frame could be calibrated.
        DatasetError: no frame could be read.
        ValueError: there are no frames.
    """
    if not len(frames):
        raise ValueError("There are no frames to calibrate.")
    some, everything = evenly_spaced(len(frames), FRAMES_UNTIL_LAST_LOOK), list(range(len(frames)))
    total, number = LOOKS * len(stages) * len(some) + len(everything), itertools.count()

    def read(position: int) -> Frame:
        if observer is not None:
            observer(next(number), total)
        return frames[position]

    extrinsic = initial
    for stage in stages:
        for _ in range(LOOKS):
            extrinsic = (
                agree(stage, read, some, extrinsic, pose_prior=pose_prior, common_error=common_error)
                .estimate()
                .camera_from_lidar
            )

    aligns = is_finest(stages[-1].range)
    evidence = list[Evidence]()
    to_align, convergence = Due(evenly_spaced(len(frames), FRAMES_ALIGNED)), Convergence(len(frames))

    def estimate(consensus: Consensus, *starts: Estimate) -> Estimate:
        return consensus.aligned(evidence, common_error, starts) if aligns else consensus.estimate()

    looks = list[DriveLook]()

    def taken_in(position: int, frame: Frame, look: StageTrace, consensus: Consensus) -> None:
        looks.append(drive_look(frame, position, look))
        if aligns and to_align.reached(position):
            evidence.append(gather(frame, consensus.before))
        convergence.note(position, frame.index, lambda: estimate(consensus, *convergence.latest))

    skipped = list[BadFrame]()
    consensus = agree(stages[-1], read, everything, extrinsic, taken_in, skipped, pose_prior, common_error)
    of_networks = consensus.estimate()
    final = estimate(consensus, of_networks, *convergence.latest)
    convergence.end(final)
    if observer is not None:
        observer(total, total)
    return DriveEstimate(
        final.camera_from_lidar,
        final.covariance,
        final.frames,
        tuple(convergence.points),
        skipped=tuple(skipped),
        networks=of_networks if aligns else None,
        looks=tuple(looks),
        looked_from=extrinsic,
    )


def drive_look(frame: Frame, position: int, look: StageTrace) -> DriveLook:
    """What one look at one frame of a drive says, as the drive keeps it."""
    return DriveLook(frame.index, position, pose_vector(look.correction), look.information, look.match_error_px)


def agree(
    stage: DriveStage,
    read: Callable[[int], Frame],
    positions: list[int],
    extrinsic: Extrinsic,
    taken_in: Callable[[int, Frame, StageTrace, Consensus], None] | None = None,
    skipped: list[BadFrame] | None = None,
    pose_prior: PosePrior | None = None,
    common_error: Matrix6 | None = None,
) -> Consensus:
    """The consensus of one look of a stage at each of some frames of a drive.

    Args:
        stage: that looks.
        read: gives the frame at a position.
        positions: of the frames.
        extrinsic: under which it looks.
        taken_in: called after each frame that could be calibrated, with its position, the frame, its look and the
            consensus so far.
        skipped: frames that could not be read or calibrated are appended to it.
        pose_prior: what is known of the extrinsic beforehand.
        common_error: see `Consensus`.

    Raises:
        CalibrationError: none of the frames could be calibrated.
        DatasetError: none could be read.
    """
    failure: CalibnetError | None = None
    consensus = Consensus(extrinsic, stage.range.information, pose_prior, common_error)
    for position in positions:
        index = position
        try:
            frame = read(position)
            index = frame.index
            look = believed(stage.look(frame, stage.view(frame), extrinsic), stage.match_error_limit_px, frame)
        except (CalibrationError, DatasetError) as error:
            failure = error
            if skipped is not None:
                skipped.append(BadFrame(index, str(error)))
            continue
        consensus.add(look.correction, look.information)
        if taken_in is not None:
            taken_in(position, frame, look, consensus)
    if failure is not None and not len(consensus):
        raise failure
    return consensus


def believed(look: StageTrace, limit_px: float, frame: Frame) -> StageTrace:
    """The look, if it expects its matches to fit.

    Raises:
        CalibrationError: they do not.
    """
    if look.match_error_px > limit_px:
        usual = "check that they belong together and that the start is within the range of the first stage"
        raise CalibrationError(
            f"Picture and scan of frame {frame.index} ({frame.source}) do not fit together after stage {look.number}, "
            f"which expects its matches to be {look.match_error_px:.1f} px off (at most {limit_px:g}): "
            f"{suspicion(frame.remarks, usual)}."
        )
    return look
