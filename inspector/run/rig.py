"""Several cameras and a LiDAR: opened from folders, and solved one by one or as one rig."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np

from calibnet.calibrator import DriveCalibrator
from calibnet.datasets.folder import Folder
from calibnet.datasets.rig import RigCamera
from calibnet.errors import CalibrationError, DatasetError
from calibnet.geometry import CameraModel, PoseError, degrees_and_cm, invert, pose_error
from calibnet.geometry.prior import Tolerance
from calibnet.geometry.se3 import pose_from_vector
from calibnet.geometry.types import Extrinsic, Matrix6, Transform
from calibnet.runtime.text import one_line
from calibnet.verdict import REJECTED, Verdict, moved
from inspector.rig_result import CameraResult, Residual, RigResult

if TYPE_CHECKING:
    from calibnet.drive.rig import CameraEstimate, RigEstimate

CAMERAS = "cameras"
"""Folder of a rig that holds one folder per camera."""
NOTED, FARTHEST = (0.1, 1.0), (10.0, 50.0)
"""Deviations between ``rig_from_camera`` and the extrinsic, in degrees and cm, that are noted, and that are refused."""


class RigCalibrator(DriveCalibrator, Protocol):
    """A method that also solves several cameras as one; `calibnet.cascade.cascade.Cascade` is one."""

    def calibrate_rig(
        self,
        cameras: Sequence[RigCamera],
        initial: Extrinsic,
        observer: Callable[[int, int], None] | None = None,
        tolerance: Matrix6 | None = None,
    ) -> RigEstimate:
        """Correct ``rig_from_lidar``."""
        ...


def open_rig(folders: Sequence[Path]) -> dict[str, Folder]:
    """The cameras of a rig by name, from one folder with ``cameras/NAME/`` or from a plain folder per camera.

    Raises:
        DatasetError: there are fewer than two, two have one name, or one cannot be opened.
    """
    clouds = None
    if len(folders) == 1:
        root = folders[0]
        inside = sorted(path for path in (root / CAMERAS).glob("*") if path.is_dir())
        if len(inside) < 2:
            raise DatasetError(
                f"{root} is not a rig's folder; put a folder with images/ and calibration.yaml for each camera into "
                f"{root / CAMERAS}, and the scans into {root / 'clouds'}, or give a plain folder for each camera."
            )
        folders, clouds = inside, root / "clouds"
    names = [one_line(folder.resolve().name) for folder in folders]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise DatasetError(f"Two cameras are called {twice}; give their folders different names.")
    cameras = {}
    for name, folder in zip(names, folders, strict=True):
        own = (folder / "clouds").is_dir() or clouds is None
        cameras[name] = Folder(folder, clouds=None if own else clouds)
    return cameras


def poses(cameras: dict[str, Folder], rigid: bool) -> tuple[dict[str, Transform], Extrinsic]:
    """Each ``camera_from_rig``, and the initial ``rig_from_lidar``; the rig's frame is that of the first camera.

    Raises:
        DatasetError: only some calibrations have ``rig_from_camera``, or it contradicts the extrinsic.
    """
    given = {name: camera.calibration.rig_from_camera for name, camera in cameras.items()}
    extrinsics = {name: extrinsic_of(camera) for name, camera in cameras.items()}
    first = next(iter(cameras))
    known = {name: pose for name, pose in given.items() if pose is not None}
    if rigid and known and len(known) < len(given):
        lacking = ", ".join(name for name in given if name not in known)
        raise DatasetError(
            f"Only some calibrations have rig_from_camera; add it to those of {lacking}, or remove it from all."
        )
    if rigid and known:
        first_from_rig = invert(known[first])
        places = {name: invert(first_from_rig @ pose) for name, pose in known.items()}
        for name, off in deviations(cameras, places).items():
            if _is_beyond(off, FARTHEST):
                raise DatasetError(
                    f"Camera {name}: rig_from_camera and the extrinsics put it {off.rotation_deg:.0f}° / "
                    f"{off.translation_cm:.0f} cm apart; rig_from_camera is the camera's pose on the rig, so "
                    "correct or invert it, or correct the extrinsics."
                )
        return places, extrinsics[first]
    start = extrinsics[first]
    return {name: extrinsic @ invert(start) for name, extrinsic in extrinsics.items()}, start


def deviations(cameras: dict[str, Folder], places: dict[str, Transform]) -> dict[str, PoseError]:
    """How far each camera's extrinsic is from its place on the rig, ``camera_from_rig``, by the first one's."""
    start = extrinsic_of(next(iter(cameras.values())))
    return {name: pose_error(places[name] @ start, extrinsic_of(camera)) for name, camera in cameras.items()}


def notes_of(cameras: dict[str, Folder], together: bool) -> list[str]:
    """Sentences on the cameras' folders and, if they are solved as one, on extrinsics that are not used.

    Raises:
        DatasetError: as `poses` does.
    """
    notes = [f"{name}: {note}" for name, folder in cameras.items() for note in folder.notes]
    if together:
        places, _ = poses(cameras, together)
        notes += [
            f"{name}: its extrinsic is {degrees_and_cm(off.rotation_deg, off.translation_cm)} from its place by "
            "rig_from_camera, which is used."
            for name, off in deviations(cameras, places).items()
            if _is_beyond(off, NOTED)
        ]
    return notes


def _is_beyond(off: PoseError, limit: tuple[float, float]) -> bool:
    return off.rotation_deg > limit[0] or off.translation_cm > limit[1]


def extrinsic_of(camera: Folder) -> Extrinsic:
    """The initial ``camera_from_lidar`` of a folder."""
    extrinsic = camera.calibration.camera_from_lidar
    assert extrinsic is not None, "a folder without one is not opened"
    return extrinsic


def solve(
    method: RigCalibrator,
    cameras: dict[str, Folder],
    rigid: bool,
    miscalibration: Transform | None = None,
    observer: Callable[[str], Callable[[int, int], None]] | None = None,
    tolerance: Tolerance | None = None,
) -> RigResult:
    """Calibrate all cameras.

    Args:
        method: the method.
        cameras: cameras by name.
        rigid: whether to solve them as one rig instead of one by one.
        miscalibration: 4x4, put on the rig in the first camera's axes; the folders' extrinsics are then the reference.
        observer: makes an observer of the progress, by a name.
        tolerance: standard deviation of each camera's place on the rig; if given, they are solved as one rig too.

    Raises:
        CalibrationError: nothing could be calibrated.
    """
    together = rigid or tolerance is not None
    camera_from_rig, truth = poses(cameras, together)
    references = {name: pose @ truth for name, pose in camera_from_rig.items()} if miscalibration is not None else {}
    start = truth if miscalibration is None else miscalibration @ truth
    watch = observer or (lambda name: lambda read, total: None)
    found: dict[str, tuple[Verdict, Residual]] = {}
    if together:
        rig = [RigCamera(name, camera, camera_from_rig[name]) for name, camera in cameras.items()]
        allowed = None if tolerance is None else tolerance.covariance
        estimate = method.calibrate_rig(rig, start, watch("rig"), allowed)
        assert estimate.verdict is not None, "the cascade judges what it finds"
        for one in estimate.cameras:
            found[one.name] = of_camera(estimate.verdict, one, camera_from_rig[one.name] @ start)
    else:
        for name, camera in cameras.items():
            initial, residual = camera_from_rig[name] @ start, Residual()
            try:
                alone = method.calibrate_drive(camera, initial, watch(name))
                verdict = alone.verdict
                errors = [look.image_error_px for look in alone.looks]
                residual = Residual(float(np.median(errors)) if errors else math.nan)
            except (CalibrationError, DatasetError) as error:
                verdict = Verdict(REJECTED, str(error), initial, used=0)
            assert verdict is not None, "the cascade judges what it finds"
            found[name] = verdict, residual
    solved = [
        CameraResult(
            name, camera_of(cameras[name]), verdict, camera_from_rig[name] @ start, residual, references.get(name)
        )
        for name, (verdict, residual) in found.items()
    ]
    return RigResult(tuple(solved), rigid, "" if tolerance is None else str(tolerance))


def camera_of(folder: Folder) -> CameraModel:
    """The camera of a folder, lens included."""
    camera = folder.calibration.camera
    assert camera is not None, "a folder without one is not opened"
    return camera


def of_camera(rig: Verdict, found: CameraEstimate, initial: Extrinsic) -> tuple[Verdict, Residual]:
    """The verdict and the residuals of one camera of a rig, which started from ``initial``."""
    verdict = replace(
        rig,
        camera_from_lidar=found.camera_from_lidar,
        covariance=None if rig.covariance is None else found.covariance,
        moved=moved(initial, found.camera_from_lidar),
    )
    residual = Residual(found.match_error_px)
    if found.alone is not None:
        off = pose_error(pose_from_vector(found.alone), np.eye(4))
        residual = Residual(found.match_error_px, off.rotation_deg, off.translation_cm)
    return verdict, residual
