"""Several cameras and a LiDAR: opened from folders, and solved each on its own or as one rig."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Protocol

import numpy as np

from calibnet.datasets.folder import Folder
from calibnet.datasets.rig import RigCamera
from calibnet.errors import CalibrationError, DatasetError
from calibnet.geometry import CameraModel, invert, pose_error
from calibnet.geometry.se3 import adjoint
from calibnet.geometry.types import Extrinsic, Transform
from calibnet.methods.calibrator import DriveCalibrator
from calibnet.trace import DriveEstimate
from calibnet.verdict import ACCEPTED, CANNOT_TELL, REJECTED, Verdict, Word
from inspector.export.exported import Exported
from inspector.verdicts import explained

CAMERAS = "cameras"
"""Folder in which each camera of a rig has its own."""


class RigCalibrator(DriveCalibrator, Protocol):
    """A method that also solves several cameras as one; `calibnet.cascade.cascade.Cascade` is one."""

    def calibrate_rig(
        self,
        cameras: Sequence[RigCamera],
        initial: Extrinsic,
        observer: Callable[[int, int], None] | None = None,
    ) -> DriveEstimate:
        """Correct ``rig_from_lidar``."""
        ...


@dataclass(frozen=True, eq=False)
class SolvedCamera:
    """What was found of one camera.

    Attributes:
        name: of the camera.
        camera: as it is, lens included.
        verdict: on what was found, with the extrinsic.
        reference: the true ``camera_from_lidar``, or None where nobody knows it.
    """

    name: str
    camera: CameraModel
    verdict: Verdict
    reference: Extrinsic | None = field(default=None, repr=False)

    def line(self) -> str:
        """A sentence for the terminal."""
        turned, shifted = self.verdict.moved
        said = f"{self.name}: {self.verdict.word}, corrected by {turned:.2f}° / {shifted:.1f} cm"
        if self.verdict.covariance is not None:
            sigma = np.sqrt([np.trace(self.verdict.covariance[rows, rows]) for rows in (slice(3, 6), slice(3))])
            said += f", sure to {np.degrees(sigma[0]):.2f}° / {100 * sigma[1]:.1f} cm"
        if self.reference is not None:
            error = pose_error(self.verdict.camera_from_lidar, self.reference)
            said += f", off the reference by {error.rotation_deg:.2f}° / {error.translation_cm:.1f} cm"
        return f"{said}." if self.verdict.word == ACCEPTED else f"{said}. {explained(self.verdict)}"


@dataclass(frozen=True)
class Solved:
    """What was found of all cameras of a rig."""

    cameras: tuple[SolvedCamera, ...]
    rigid: bool

    @property
    def word(self) -> Word:
        """Accepted if all cameras are, rejected if one is."""
        words = {camera.verdict.word for camera in self.cameras}
        return REJECTED if REJECTED in words else CANNOT_TELL if CANNOT_TELL in words else ACCEPTED

    def lines(self) -> Iterator[str]:
        """Sentences for the terminal; the last one is the verdict on all."""
        yield from (camera.line() for camera in self.cameras)
        how = "as one rigid rig" if self.rigid else "each on its own"
        yield f"Verdict: {self.word}, of {len(self.cameras)} cameras {how}."

    def as_dict(self) -> dict[str, object]:
        """The JSON object: ``cameras`` by name, each with what `Verdict.as_dict` says."""
        cameras = {camera.name: camera.verdict.as_dict() for camera in self.cameras}
        return {"verdict": self.word, "rigid": self.rigid, "cameras": cameras}

    def exported(self) -> dict[str, Exported]:
        """What is not rejected, by the camera's name."""
        return {
            one.name: Exported(
                one.verdict.camera_from_lidar, one.camera, f"rig, camera {one.name}", verdict=one.verdict
            )
            for one in self.cameras
            if one.verdict.word != REJECTED
        }


def open_rig(folders: Sequence[Path]) -> dict[str, Folder]:
    """The cameras of a rig by name: of one folder with ``cameras/NAME/``, or of a plain folder each.

    Raises:
        DatasetError: there are fewer than two, two have one name, or one cannot be opened.
    """
    clouds = None
    if len(folders) == 1:
        root = folders[0]
        inside = sorted(path for path in (root / CAMERAS).glob("*") if path.is_dir())
        if len(inside) < 2:
            raise DatasetError(
                f"{root} holds no rig: put a folder of images/ and calibration.yaml for each camera into "
                f"{root / CAMERAS}, and the scans into {root / 'clouds'}; or give a plain folder for each camera."
            )
        folders, clouds = inside, root / "clouds"
    names = [folder.resolve().name for folder in folders]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise DatasetError(f"Two cameras are called {twice}; give their folders different names.")
    cameras = {}
    for name, folder in zip(names, folders, strict=True):
        own = (folder / "clouds").is_dir() or clouds is None
        cameras[name] = Folder(folder, clouds=None if own else clouds)
    return cameras


def poses(cameras: dict[str, Folder], rigid: bool) -> tuple[dict[str, Transform], Extrinsic]:
    """Each ``camera_from_rig``, and ``rig_from_lidar`` to start from; the rig's frame is that of the first camera.

    Raises:
        DatasetError: the calibrations say it of some cameras only.
    """
    given = {name: camera.calibration.rig_from_camera for name, camera in cameras.items()}
    extrinsics = {name: extrinsic_of(camera) for name, camera in cameras.items()}
    first = next(iter(cameras))
    known = {name: pose for name, pose in given.items() if pose is not None}
    if rigid and known and len(known) < len(given):
        lacking = ", ".join(name for name in given if name not in known)
        raise DatasetError(f"Only some calibrations say rig_from_camera; add it to that of {lacking}, or to none.")
    if rigid and known:
        first_from_rig = invert(known[first])
        return {name: invert(first_from_rig @ pose) for name, pose in known.items()}, extrinsics[first]
    start = extrinsics[first]
    return {name: extrinsic @ invert(start) for name, extrinsic in extrinsics.items()}, start


def extrinsic_of(camera: Folder) -> Extrinsic:
    """The ``camera_from_lidar`` that a folder starts from."""
    extrinsic = camera.calibration.camera_from_lidar
    assert extrinsic is not None, "a folder without one is not opened"
    return extrinsic


def solve(
    method: RigCalibrator,
    cameras: dict[str, Folder],
    rigid: bool,
    miscalibration: Transform | None = None,
    observer: Callable[[str], Callable[[int, int], None]] | None = None,
) -> Solved:
    """Calibrate all cameras.

    Args:
        method: that does it.
        cameras: by name.
        rigid: as one rig, instead of each on its own.
        miscalibration: 4x4, put on the rig in the first camera's axes; what the folders say is the truth then.
        observer: makes what is told of the progress, by a name.

    Raises:
        CalibrationError: nothing could be calibrated.
    """
    camera_from_rig, start = poses(cameras, rigid)
    references = {name: pose @ start for name, pose in camera_from_rig.items()} if miscalibration is not None else {}
    start = start if miscalibration is None else miscalibration @ start
    watch = observer or (lambda name: lambda read, total: None)
    found: dict[str, Verdict] = {}
    if rigid:
        rig = [RigCamera(name, camera, camera_from_rig[name]) for name, camera in cameras.items()]
        estimate = method.calibrate_rig(rig, start, watch("rig"))
        assert estimate.verdict is not None, "the cascade judges what it finds"
        found = {name: of_camera(estimate.verdict, pose) for name, pose in camera_from_rig.items()}
    else:
        for name, camera in cameras.items():
            initial = camera_from_rig[name] @ start
            try:
                verdict = method.calibrate_drive(camera, initial, watch(name)).verdict
            except (CalibrationError, DatasetError) as error:
                verdict = Verdict(REJECTED, str(error), initial, used=0)
            assert verdict is not None, "the cascade judges what it finds"
            found[name] = verdict
    solved = [
        SolvedCamera(name, cameras[name][0].as_taken.camera, verdict, references.get(name))
        for name, verdict in found.items()
    ]
    return Solved(tuple(solved), rigid)


def of_camera(rig: Verdict, camera_from_rig: Transform) -> Verdict:
    """The verdict on a rig as one on a camera of it: its extrinsic, and its covariance in its own frame."""
    covariance = rig.covariance
    if covariance is not None:
        to_camera = adjoint(camera_from_rig)
        covariance = to_camera @ covariance @ to_camera.T
    return replace(rig, camera_from_lidar=camera_from_rig @ rig.camera_from_lidar, covariance=covariance)
