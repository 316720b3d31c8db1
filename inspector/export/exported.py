"""The content of an export: one extrinsic, its camera and their origin."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from calibnet.datasets.folder import read_calibration_of
from calibnet.geometry import CameraModel
from calibnet.geometry.types import Extrinsic, Matrix6
from calibnet.verdict import ACCEPTED, Verdict
from inspector.read.run import RecordedRun
from inspector.read.understood import RecordingError
from inspector.rig_result import CameraResult
from inspector.verdicts import explained


class FrameNames(NamedTuple):
    """Names of the two coordinate frames, and whether the LiDAR's is the parent, for formats that use them."""

    camera: str = "camera_optical_frame"
    lidar: str = "lidar"
    lidar_is_parent: bool = True


@dataclass(frozen=True, eq=False)
class Exported:
    """A calibration to be exported.

    Attributes:
        camera_from_lidar: 4x4, metres.
        camera: the camera itself, lens included.
        origin: origin of the calibration for the file's comment, with the verdict where it is not accepted.
        frames: names of the two coordinate frames.
        verdict: verdict on the calibration; None where there is none.
    """

    camera_from_lidar: Extrinsic = field(repr=False)
    camera: CameraModel
    origin: str
    frames: FrameNames = field(default_factory=FrameNames)
    verdict: Verdict | None = field(default=None, repr=False)

    @property
    def covariance(self) -> Matrix6 | None:
        """Of ``(translation m, rotation rad)`` in the camera's frame, 6x6; None where nothing states it."""
        return None if self.verdict is None else self.verdict.covariance


def exported_frame(run: RecordedRun, index: int) -> Exported:
    """The exact result of one frame, accepted or not.

    Raises:
        RecordingError: the recording has no such frame.
    """
    for frame in run.frames:
        if frame.index == index:
            found = frame.verdict.camera_from_lidar
            return _judged(found, frame.camera, f"{run.title}, frame {index}", frame.verdict)
    first, last = run.frames[0].index, run.frames[-1].index
    raise RecordingError(f"{run.path} has no complete frame {index}; choose one from {first} to {last}.")


def exported_median(run: RecordedRun) -> Exported:
    """The median of the results of the frames that are not rejected, or of all if all are; see `median_pose`.

    Raises:
        RecordingError: the frames do not share one camera and one mount.
    """
    camera = run.frames[0].camera
    if not (run.one_mount and all(camera.same(frame.camera) for frame in run.frames)):
        raise RecordingError(
            f"The frames of {run.path} come from several cameras or mounts; choose one frame with --frame."
        )
    count = sum(not frame.rejected for frame in run.frames) or len(run.frames)
    origin = f"{run.title}, median of {count} frame{'' if count == 1 else 's'}"
    verdict = run.frames_verdict
    return _judged(verdict.camera_from_lidar, camera, origin, verdict)


def exported_drive(run: RecordedRun) -> Exported:
    """The extrinsic that the run solved from all frames together.

    Raises:
        RecordingError: the run did not solve a drive.
    """
    if run.drive is None:
        raise RecordingError(
            f"{run.path} has no estimate from the whole drive; record it with --drive, or use --median."
        )
    origin = f"{run.title}, all frames solved together"
    return _judged(run.drive, run.frames[0].camera, origin, run.drive_verdict)


def exported_camera(result: CameraResult) -> Exported:
    """The result of one camera of a rig, accepted or not."""
    return _judged(result.verdict.camera_from_lidar, result.camera, f"rig, camera {result.name}", result.verdict)


def exported_folder(folder: Path) -> Exported:
    """The calibration of a plain folder, from its ``calibration.yaml`` or the file of another tool.

    Raises:
        DatasetError: the file is missing or malformed, or lacks camera or extrinsic.
    """
    path, camera, extrinsic = read_calibration_of(folder)
    return Exported(extrinsic, camera, f"{folder.name}/{path.name}")


def _judged(extrinsic: Extrinsic, camera: CameraModel, origin: str, verdict: Verdict | None) -> Exported:
    """A calibration with the verdict of its recording."""
    if verdict is not None and verdict.word != ACCEPTED:
        origin = f"{origin}; {verdict.word}: {explained(verdict)}"
    return Exported(extrinsic, camera, origin, verdict=verdict)
