"""Solves one pose of a rig of several cameras whose relative poses are known.

What one camera determines badly, such as the distance ahead, another one that looks sideways determines well. The
frames of each camera are solved together like those of a drive. The result, with its covariance and the common error of
the networks, is one measurement of the rig's pose (`calibnet.drive.rig_pose`); the cameras' normal equations are added
in the rig's frame. At the end, edges of all cameras are aligned by that one pose.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Self

import numpy as np

from calibnet.alignment import gather
from calibnet.alignment.evidence import Evidence, InRig, Term
from calibnet.alignment.solve import align
from calibnet.datasets.rig import RigCamera
from calibnet.datasets.selection import evenly_spaced
from calibnet.drive.consensus import FARTHEST_ROTATION_DEG, FARTHEST_TRANSLATION_M, Consensus
from calibnet.drive.convergence import Due
from calibnet.drive.readings import Observed, Readings
from calibnet.drive.rig_pose import CameraConsensus, rig_correction
from calibnet.drive.solve import (
    FRAMES_ALIGNED,
    FRAMES_UNTIL_LAST_LOOK,
    LOOKS,
    DriveLooks,
    DriveStage,
    agree,
    drive_look,
)
from calibnet.errors import CalibnetError, CalibrationError, DatasetError
from calibnet.geometry import is_finest, transform
from calibnet.geometry.prior import PosePrior
from calibnet.geometry.se3 import adjoint, invert, pose_from_vector, pose_vector, rotate6, rotated
from calibnet.geometry.types import Extrinsic, Matrix6, Rotation, Transform, Vector6
from calibnet.trace import DriveEstimate, DriveLook, Estimate
from calibnet.verdict import BadFrame


@dataclass(frozen=True, eq=False)
class CameraEstimate:
    """The result of one camera of a rig.

    Attributes:
        name: name of the camera.
        camera_from_lidar: 4x4.
        covariance: covariance ``[6, 6]``, in the camera's frame.
        frames: number of frames used; with none, the camera's pose is that of the rig.
        match_error_px: median match error that the last look expects, in pixels of the camera's images; NaN
            without frames.
        alone: ``[6]``, offset from there to the result of its own frames; None without frames.
        alone_covariance: covariance ``[6, 6]`` of the result of its own frames.
    """

    name: str
    camera_from_lidar: Extrinsic = field(repr=False)
    covariance: Matrix6 = field(repr=False)
    frames: int
    match_error_px: float = math.nan
    alone: Vector6 | None = field(default=None, repr=False)
    alone_covariance: Matrix6 | None = field(default=None, repr=False)

    def rotated(self, rotation: Rotation) -> CameraEstimate:
        """The result for a camera turned by ``rotation [3, 3]``."""
        return replace(
            self,
            camera_from_lidar=transform(rotation, np.zeros(3)) @ self.camera_from_lidar,
            covariance=rotated(self.covariance, rotation),
            alone=None if self.alone is None else rotate6(rotation) @ self.alone,
            alone_covariance=rotated(self.alone_covariance, rotation),
        )


@dataclass(frozen=True, eq=False)
class RigEstimate(DriveEstimate):
    """The pose of a rig: ``camera_from_lidar`` is ``rig_from_lidar``, with the covariance in the rig's frame.

    Attributes:
        cameras: results of the cameras, in order.
    """

    cameras: tuple[CameraEstimate, ...] = field(repr=False, default=())

    def inflated(self, factor: float) -> Self:
        """The estimate with every covariance multiplied by ``factor``, those of the cameras too."""
        cameras = tuple(
            replace(
                one,
                covariance=factor * one.covariance,
                alone_covariance=None if one.alone_covariance is None else factor * one.alone_covariance,
            )
            for one in self.cameras
        )
        return replace(super().inflated(factor), cameras=cameras)


def solve_rig(
    stages: Sequence[DriveStage],
    cameras: Sequence[RigCamera],
    initial: Extrinsic,
    common_error: Matrix6,
    observer: Callable[[int, int], None] | None = None,
    pose_prior: PosePrior | None = None,
    tolerance: Matrix6 | None = None,
) -> RigEstimate:
    """Correct ``rig_from_lidar``, as `calibnet.drive.solve.solve_drive` does for one camera.

    A camera without usable frames is left out, and its frames count as skipped.

    Args:
        stages: stages, coarse to fine.
        cameras: cameras of the rig; each frame is read in the last look, and some before.
        initial: ``rig_from_lidar`` to start from.
        common_error: covariance of the error that the networks make in all frames of one camera.
        observer: called before each frame is read and at the end, with how many are read so far, and in all.
        pose_prior: prior on the rig's pose.
        tolerance: covariance ``[6, 6]`` of each camera's pose on the rig, in its own frame; None for a rigid rig.

    Raises:
        CalibrationError: no frame of any camera could be calibrated.
        DatasetError: none could be read.
    """
    counts = [len(camera.frames) for camera in cameras]
    until_last = sum(min(count, FRAMES_UNTIL_LAST_LOOK) for count in counts)
    readings = Readings(observer, LOOKS * len(stages) * until_last + sum(counts))
    cameras = [replace(camera, frames=Observed(camera.frames, readings)) for camera in cameras]
    rig, places = initial, {camera.name: camera.camera_from_rig for camera in cameras}
    for stage in stages:
        for _ in range(LOOKS):
            agreed = _agreed(cameras, partial(_look_at_some, stage, rig, places), common_error)
            rig = pose_from_vector(rig_correction(agreed, rig, pose_prior, tolerance)[0]) @ rig
            places |= {one.camera.name: one.placed(rig, tolerance) for one in agreed}
    aligns = is_finest(stages[-1].range)
    last = _LastLook(stages[-1], rig, places, max(1, FRAMES_ALIGNED // len(cameras)) if aligns else 0)
    agreed = _agreed(cameras, last.at, common_error)
    mean, covariance = rig_correction(agreed, rig, pose_prior, tolerance)
    of_networks = Estimate(pose_from_vector(mean) @ rig, covariance, len(last.looks))
    if aligns:
        too_far = (
            of_networks.rotation_deg > FARTHEST_ROTATION_DEG
            or of_networks.translation_cm > 100 * FARTHEST_TRANSLATION_M
        )
        mean, covariance = align(() if too_far else [Evidence((term,)) for term in last.terms], mean, covariance)
    found = Estimate(pose_from_vector(mean) @ rig, covariance, len(last.looks))
    readings.end()
    return RigEstimate(
        found.camera_from_lidar,
        found.covariance,
        found.frames,
        ((found.frames, found),),
        skipped=tuple(last.skipped),
        networks=of_networks if aligns else None,
        looks=tuple(last.looks),
        looked_from=rig,
        cameras=tuple(_of_cameras(cameras, agreed, found, last.of_camera, tolerance)),
    )


def _agreed(
    cameras: Sequence[RigCamera], look_at: Callable[[RigCamera], Consensus], common_error: Matrix6
) -> list[CameraConsensus]:
    """The consensus of each camera's frames in one look, without cameras that have no usable frames."""
    found = list[CameraConsensus]()
    failure: CalibnetError | None = None
    for camera in cameras:
        try:
            found.append(CameraConsensus.of(camera, look_at(camera), common_error))
        except (CalibrationError, DatasetError) as error:
            failure = error
    if failure is not None and not found:
        raise failure
    return found


def _look_at_some(stage: DriveStage, rig: Extrinsic, places: dict[str, Transform], camera: RigCamera) -> Consensus:
    """Look at some frames of a camera at its place on the rig (``camera_from_rig``)."""
    some = evenly_spaced(len(camera.frames), FRAMES_UNTIL_LAST_LOOK)
    return agree(DriveLooks(stage, camera.frames, some, places[camera.name] @ rig))


class _LastLook:
    """The last look, at all frames, and its results.

    Attributes:
        skipped: frames that could not be read or calibrated.
        looks: looks of all cameras, as looks of the rig.
        of_camera: looks of each camera by its name, in its own frame.
        terms: edges and reflectance of the frames to align, as functions of the rig's pose.
    """

    def __init__(self, stage: DriveStage, rig: Extrinsic, places: dict[str, Transform], aligned: int) -> None:
        """Look with ``stage`` from ``rig``, and collect edges of ``aligned`` frames of each camera."""
        self.stage, self.rig, self.places, self.aligned = stage, rig, places, aligned
        self.skipped, self.looks, self.terms = list[BadFrame](), list[DriveLook](), list[Term]()
        self.of_camera = defaultdict[str, list[DriveLook]](list)

    def at(self, camera: RigCamera) -> Consensus:
        """Look at all frames of a camera."""
        place, count = self.places[camera.name], len(camera.frames)
        due = Due(evenly_spaced(count, self.aligned) if self.aligned else [])
        looks = DriveLooks(self.stage, camera.frames, range(count), place @ self.rig)
        consensus = Consensus(looks.extrinsic, self.stage.range)
        try:
            for position, frame, trace in looks:
                consensus.add(trace.correction, trace.information)
                look = drive_look(frame, position, trace)
                self.of_camera[camera.name].append(look)
                self.looks.append(replace(in_rig(look, place), camera=camera.name))
                if due.reached(position):
                    self.terms.append(InRig(gather(frame, looks.extrinsic), place))
        finally:
            self.skipped += looks.skipped
        return consensus


def in_rig(look: DriveLook, camera_from_rig: Transform) -> DriveLook:
    """A camera's look as one of its rig."""
    offset = pose_vector(invert(camera_from_rig) @ pose_from_vector(look.offset) @ camera_from_rig)
    to_camera = adjoint(camera_from_rig)
    information = None if look.information is None else to_camera.T @ look.information @ to_camera
    return replace(look, offset=offset, information=information)


def _of_cameras(
    cameras: Sequence[RigCamera],
    agreed: Sequence[CameraConsensus],
    rig: Estimate,
    looks: dict[str, list[DriveLook]],
    tolerance: Matrix6 | None,
) -> Iterator[CameraEstimate]:
    """The results of the cameras."""
    by_name = {one.camera.name: one for one in agreed}
    for camera in cameras:
        one = by_name.get(camera.name)
        if one is None:
            to_camera, wide = adjoint(camera.camera_from_rig), 0.0 if tolerance is None else tolerance
            there = camera.camera_from_rig @ rig.camera_from_lidar
            yield CameraEstimate(camera.name, there, to_camera @ rig.covariance @ to_camera.T + wide, 0)
            continue
        there = one.placed(rig.camera_from_lidar, tolerance) @ rig.camera_from_lidar
        yield CameraEstimate(
            camera.name,
            there,
            one.spread(rig.covariance, tolerance),
            len(looks[camera.name]),
            float(np.median([look.image_error_px for look in looks[camera.name]])),
            pose_vector(one.camera_from_lidar @ invert(there)),
            one.covariance,
        )
