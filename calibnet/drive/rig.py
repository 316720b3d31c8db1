"""One pose of a rig of several cameras, which are known relative to each other: what is blind to one, another sees.

Every camera's frames agree on a correction of that camera, as those of a drive do. What they agree on, with its
uncertainty and with what the networks get wrong in all frames of one camera alike, is one measurement of the rig's
pose; their normal equations add up in the rig's frame. Edges of all cameras are aligned by that one pose in the end.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence

import numpy as np

from calibnet.alignment import gather
from calibnet.alignment.evidence import Evidence, InRig, Term
from calibnet.alignment.solve import align
from calibnet.datasets.frame import Frame
from calibnet.datasets.rig import RigCamera
from calibnet.datasets.selection import spread
from calibnet.drive.consensus import FARTHEST_ROTATION_DEG, FARTHEST_TRANSLATION_M, Consensus
from calibnet.drive.convergence import Due
from calibnet.drive.solve import FRAMES_ALIGNED, FRAMES_UNTIL_LAST_LOOK, LOOKS, Looking, agree
from calibnet.errors import CalibnetError, CalibrationError, DatasetError
from calibnet.geometry import is_finest
from calibnet.geometry.known import Held, inverse
from calibnet.geometry.se3 import adjoint, invert, pose_from_vector, pose_vector
from calibnet.geometry.types import Extrinsic, Matrix6, Vector6
from calibnet.trace import DriveEstimate, Estimate, StageTrace
from calibnet.verdict import BadFrame


def joined(
    cameras: Sequence[RigCamera], agreed: Sequence[Consensus], common: Matrix6, held: Held | None, rig: Extrinsic
) -> tuple[Vector6, Matrix6]:
    """The correction of a rig's pose that its cameras agree on, and its covariance.

    Args:
        cameras: of the rig.
        agreed: what the frames of each agree on, relative to where it is under ``rig``.
        common: covariance of what the networks get wrong in all frames of one camera alike.
        held: what is known of the rig's pose beforehand.
        rig: ``rig_from_lidar`` that is corrected.
    """
    information, moment = np.zeros((6, 6)), np.zeros(6)
    for camera, consensus in zip(cameras, agreed, strict=True):
        mean, covariance = consensus.agreed()
        to_camera = adjoint(camera.camera_from_rig)
        firm = to_camera.T @ inverse(covariance + common) @ to_camera
        of_rig = invert(camera.camera_from_rig) @ pose_from_vector(mean) @ camera.camera_from_rig
        information, moment = information + firm, moment + firm @ pose_vector(of_rig)
    mean = np.asarray(np.linalg.solve(information, moment), np.float64)
    return (mean, inverse(information)) if held is None else held.fused(mean, information, rig)


def solve_rig(
    stages: Sequence[Looking],
    cameras: Sequence[RigCamera],
    initial: Extrinsic,
    common: Matrix6,
    observer: Callable[[int, int], None] | None = None,
    held: Held | None = None,
) -> DriveEstimate:
    """Correct ``rig_from_lidar``, as `calibnet.drive.solve.solve_drive` does with one camera.

    A camera of whose frames none can be used is left out, and its frames count as skipped.

    Args:
        stages: coarse to fine.
        cameras: of the rig; each frame is read in the last look, and some before.
        initial: ``rig_from_lidar`` to start from.
        common: covariance of what the networks get wrong in all frames of one camera alike.
        observer: called before each frame is read, with the number of frames read so far and to be read in all.
        held: what is known of the rig's pose beforehand.

    Raises:
        CalibrationError: no frame of any camera could be calibrated.
        DatasetError: none could be read.
    """
    some = [spread(len(camera.frames), FRAMES_UNTIL_LAST_LOOK) for camera in cameras]
    everything = [list(range(len(camera.frames))) for camera in cameras]
    total, number = LOOKS * len(stages) * sum(map(len, some)) + sum(map(len, everything)), itertools.count()
    skipped, terms = list[BadFrame](), list[Term]()
    rig = initial

    def look(stage: Looking, positions: list[list[int]], last: bool) -> tuple[list[RigCamera], list[Consensus]]:
        """What the frames of each camera agree on, of those that have any that can be used."""
        used, found = list[RigCamera](), list[Consensus]()
        failure: CalibnetError | None = None
        for camera, chosen in zip(cameras, positions, strict=True):

            def read(position: int, camera: RigCamera = camera) -> Frame:
                if observer is not None:
                    observer(next(number), total)
                return camera.frames[position]

            to_align = Due(spread(len(camera.frames), max(1, FRAMES_ALIGNED // len(cameras))))

            def taken_in(
                position: int,
                frame: Frame,
                _: StageTrace,
                consensus: Consensus,
                camera: RigCamera = camera,
                due: Due = to_align,
            ) -> None:
                if aligns and due.reached(position):
                    terms.append(InRig(gather(frame, consensus.before), camera.camera_from_rig))

            try:
                before = camera.camera_from_rig @ rig
                consensus = agree(stage, read, chosen, before, taken_in if last else None, skipped if last else None)
            except (CalibrationError, DatasetError) as error:
                failure = error
                continue
            used.append(camera)
            found.append(consensus)
        if failure is not None and not used:
            raise failure
        return used, found

    aligns = is_finest(stages[-1].range)
    for stage in stages:
        for _ in range(LOOKS):
            mean, _covariance = joined(*look(stage, some, last=False), common, held, rig)
            rig = pose_from_vector(mean) @ rig
    used, agreed = look(stages[-1], everything, last=True)
    mean, covariance = joined(used, agreed, common, held, rig)
    frames = sum(map(len, agreed))
    of_networks = Estimate(pose_from_vector(mean) @ rig, covariance, frames)
    if aligns:
        too_far = (
            of_networks.rotation_deg > FARTHEST_ROTATION_DEG
            or of_networks.translation_cm > 100 * FARTHEST_TRANSLATION_M
        )
        mean, covariance = align(() if too_far else [Evidence((term,)) for term in terms], mean, covariance)
    found = Estimate(pose_from_vector(mean) @ rig, covariance, frames)
    return DriveEstimate(
        found.camera_from_lidar,
        found.covariance,
        frames,
        ((frames, found),),
        skipped=tuple(skipped),
        networks=of_networks if aligns else None,
    )
