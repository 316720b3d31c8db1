"""PCBA as a method that solves drives: rounds of adjustment, each with a new assignment of landmarks to planes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from calibnet.datasets.frame import Frame, Frames, index_of
from calibnet.errors import CalibrationError, DatasetError
from calibnet.exhibit import Curve
from calibnet.geometry import MiscalibrationRange, PinholeCamera
from calibnet.geometry.se3 import invert
from calibnet.geometry.types import Extrinsic, Floats, Transform
from calibnet.methods.pcba.adjustment import Adjusted, Problem
from calibnet.methods.pcba.exhibits import exhibits
from calibnet.methods.pcba.planes import Planes, planes_of
from calibnet.methods.pcba.tracks import Tracks, follow
from calibnet.motion.odometry import longest_run, path
from calibnet.trace import CascadeTrace, DriveEstimate, Estimate, StageTrace
from calibnet.verdict import CANNOT_TELL, BadFrame, Verdict, moved

MOST_FRAMES = 24
"""Largest number of frames of a drive; the first ones are used, as points are tracked through successive frames."""
LEAST_MOTION_M = 2.0
"""Shortest distance, in metres, that the car has to drive: without motion there is no parallax."""
FEWEST = 60
"""Fewest landmarks on planes that are adjusted."""
MOST_LANDMARKS = 1200
FARTHEST = 2.0
"""Results farther away than this multiple of the range are refused: an unconstrained adjustment ends metres away."""


class Round(NamedTuple):
    """A round of adjustment.

    Attributes:
        within_m: largest distance of a landmark from the plane that it is assigned to.
        worst_px: landmarks with a larger reprojection error in any frame are dropped.
        shift: factor on the prior standard deviation of the translation.
    """

    within_m: float
    worst_px: float
    shift: float = 1.0


TURN = (Round(2.0, 15.0, 0.02), Round(1.5, 8.0, 0.02), Round(1.0, 6.0, 0.1))
"""Rounds that adjust mostly the rotation. Motion determines it whatever the translation is, and the depths of tracked
points depend on it."""
ALL = (Round(2.0, 8.0), Round(1.0, 5.0), Round(0.7, 4.0), Round(0.5, 3.0), Round(0.5, 3.0))
"""Rounds that then adjust everything, with points tracked again from their depths under the new extrinsic."""
COVARIANCE_WIDER = 9.0
"""Inflation of the residuals' covariance: errors of registration, shutters and planes are common to all frames."""


@dataclass(frozen=True, eq=False)
class Drive:
    """The frames of a drive that are used.

    Attributes:
        indices: indices of the frames.
        images: grey images, ``[H, W]``.
        scans: scans, ``[N, 4]``.
        poses: ``world_from_lidar`` of each frame.
        camera: the camera of all frames.
        skipped: frames that could not be read.
    """

    indices: list[int]
    images: list[NDArray[np.uint8]] = field(repr=False)
    scans: list[NDArray[np.float32]] = field(repr=False)
    poses: list[Transform] = field(repr=False)
    camera: PinholeCamera
    skipped: tuple[BadFrame, ...] = ()


class PCBA:
    """A `DriveCalibrator` without weights, for drives that move."""

    drives_only = True

    def __init__(self, range_: MiscalibrationRange, intrinsics: bool = False) -> None:
        """Expect miscalibrations within ``range_``; adjust the camera's ``intrinsics`` as well."""
        self.range, self.intrinsics = range_, intrinsics

    def calibrate(self, frame: Frame, initial: Extrinsic, detail: bool = False) -> CascadeTrace:
        """Always fails, because a single frame has no motion.

        Raises:
            CalibrationError: always.
        """
        raise CalibrationError("pcba needs several frames of a moving car; give a drive instead of one frame.")

    def calibrate_drive(
        self, frames: Frames, initial: Extrinsic, observer: Callable[[int, int], None] | None = None
    ) -> DriveEstimate:
        """Adjust the extrinsic of the first `MOST_FRAMES` of a drive.

        Raises:
            CalibrationError: the drive does not move, too few points can be tracked, or the adjustment
                ends far out of the range.
        """
        drive = read_drive(frames, observer)
        metres, _ = path(drive.poses)
        if metres < LEAST_MOTION_M:
            raise CalibrationError(
                f"pcba needs a moving car: this one moves {metres:.1f} m in the {len(drive.poses)} frames whose "
                f"scans can be registered, but {LEAST_MOTION_M:g} m are needed."
            )
        planes = planes_of(drive.scans, drive.poses)
        rounds: list[tuple[Tracks, Adjusted]] = []
        extrinsic = initial
        for schedule in (TURN, ALL):
            rounds += self._rounds(drive, planes, schedule, extrinsic, initial)
            extrinsic = rounds[-1][1].camera_from_lidar
        if not self.range.contains(initial @ invert(extrinsic), FARTHEST):
            turned, shifted = moved(initial, extrinsic)
            raise CalibrationError(
                f"The result of pcba is {turned:.1f}° and {shifted:.0f} cm from the start, far outside the range "
                f"{self.range.label}: the drive does not determine the extrinsic, or the start is too far off."
            )
        return self._estimate(drive, planes, rounds, initial)

    def _rounds(
        self, drive: Drive, planes: Planes, schedule: tuple[Round, ...], extrinsic: Extrinsic, initial: Extrinsic
    ) -> Iterator[tuple[Tracks, Adjusted]]:
        """Track points; then, in every round, adjust, drop landmarks that do not fit, and assign planes again."""
        tracks = sample_tracks(follow(drive.images, drive.scans, drive.poses, drive.camera, extrinsic))
        known = np.array([self.range.translation_m] * 3 + [np.radians(self.range.rotation_deg)] * 3) / 3**0.5
        lidar_from_world = np.stack([invert(pose) for pose in drive.poses])
        landmarks = tracks.start
        for one in schedule:
            rows, on = planes.nearest(landmarks, one.within_m)
            if on.sum() < FEWEST:
                raise CalibrationError(
                    f"Only {int(on.sum())} points tracked through the images are on planes of the "
                    f"scans, but {FEWEST} are needed; give a better guess."
                )
            tracks, landmarks, rows = tracks.only(on), landmarks[on], rows[on]
            problem = Problem(
                tracks, lidar_from_world, drive.camera, initial, known * ([one.shift] * 3 + [1.0] * 3), self.intrinsics
            )
            found = problem.adjusted_from(extrinsic, landmarks, planes, rows, np.ones(len(rows), bool))
            off = np.zeros(len(landmarks))
            np.maximum.at(off, tracks.landmark, found.reprojection)
            yield tracks, found
            kept = off < max(one.worst_px, float(np.median(off)))
            tracks, landmarks, extrinsic = tracks.only(kept), found.landmarks[kept], found.camera_from_lidar

    def _estimate(
        self, drive: Drive, planes: Planes, rounds: list[tuple[Tracks, Adjusted]], initial: Extrinsic
    ) -> DriveEstimate:
        """The result of the last round, with the exhibits of every frame."""
        tracks, found = rounds[-1]
        extrinsic, covariance = found.camera_from_lidar, COVARIANCE_WIDER * found.covariance
        curves = (
            Curve("Reprojection error of landmarks in pixels (median), by round", _medians(rounds)),
            Curve("Landmarks on planes, by round", np.array([float(len(t.start)) for t, _ in rounds])),
        )
        correction = extrinsic @ invert(initial)
        stage = StageTrace(1, self.range, found.camera, initial, correction @ initial, correction, curves=curves)
        traces = {}
        for position, index in enumerate(drive.indices):
            shown = exhibits(drive.images[position], position, tracks, found, planes, drive.poses[position])
            traces[index] = CascadeTrace(initial, (replace(stage, exhibits=shown),))
        history = tuple(
            (index, Estimate(one.camera_from_lidar, COVARIANCE_WIDER * one.covariance, len(drive.indices)))
            for index, (_, one) in zip(drive.indices, rounds, strict=False)
        )
        history = (*history, (drive.indices[-1], Estimate(extrinsic, covariance, len(drive.indices))))
        used, verdict = len(drive.indices), None
        if self.intrinsics:
            said = intrinsics_said(drive.camera, found.camera)
            verdict = Verdict(CANNOT_TELL, said, extrinsic, moved(initial, extrinsic), covariance=covariance, used=used)
        return DriveEstimate(
            extrinsic, covariance, used, history=history, skipped=drive.skipped, verdict=verdict, traces=traces
        )


def read_drive(frames: Frames, observer: Callable[[int, int], None] | None = None) -> Drive:
    """Read frames and register their scans.

    Raises:
        CalibrationError: fewer than three can be used.
    """
    total = min(len(frames), MOST_FRAMES)
    read: list[Frame] = []
    skipped: list[BadFrame] = []
    for position in range(total):
        if observer is not None:
            observer(position, total)
        try:
            read.append(frames[position])
        except DatasetError as error:
            skipped.append(BadFrame(index_of(frames, position), str(error)))
    if observer is not None:
        observer(total, total)
    alike = [frame for frame in read if frame.camera.is_like(read[0].camera)]
    first, poses = longest_run([frame.points for frame in alike]) if alike else (0, [])
    chosen = alike[first : first + len(poses)]
    if len(chosen) < 3:
        raise CalibrationError(
            f"pcba needs at least three frames of one camera whose scans can be registered, but has {len(chosen)}."
        )
    grey = [np.asarray(cv2.cvtColor(frame.image, cv2.COLOR_RGB2GRAY), np.uint8) for frame in chosen]
    indices, scans = [frame.index for frame in chosen], [frame.points for frame in chosen]
    return Drive(indices, grey, scans, poses, chosen[0].camera, tuple(skipped))


def sample_tracks(tracks: Tracks) -> Tracks:
    """At most `MOST_LANDMARKS`, evenly from the whole drive."""
    count = len(tracks.start)
    kept = np.zeros(count, bool)
    kept[np.linspace(0, count - 1, min(count, MOST_LANDMARKS)).astype(np.int64)] = True
    return tracks.only(kept)


def intrinsics_said(before: PinholeCamera, after: PinholeCamera) -> str:
    """A sentence that says how the intrinsics changed."""
    old, new = before.matrix, after.matrix
    return (
        f"Its focal lengths were adjusted from {old[0, 0]:.1f} and {old[1, 1]:.1f} to {new[0, 0]:.1f} and "
        f"{new[1, 1]:.1f} pixels, its centre from ({old[0, 2]:.1f}, {old[1, 2]:.1f}) to "
        f"({new[0, 2]:.1f}, {new[1, 2]:.1f})."
    )


def _medians(rounds: list[tuple[Tracks, Adjusted]]) -> Floats:
    return np.array([float(np.median(found.reprojection)) for _, found in rounds])
