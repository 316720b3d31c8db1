"""KITTI-360: perspective cameras 0 and 1, which face forward, and fisheye cameras 2 and 3, which face sideways.

``calibration/{perspective,calib_cam_to_pose,calib_cam_to_velo}.txt`` and ``image_0{2,3}.yaml``,
``data_2d_raw/DRIVE/image_0N/{data_rect,data_rgb}`` and ``data_3d_raw/DRIVE/velodyne_points/data``. Poses of the car are
not needed.
"""

from __future__ import annotations

import datetime
import os
from pathlib import Path

import numpy as np

from calibnet.datasets.calibration import Calibration
from calibnet.datasets.calibration_files import read_calibration
from calibnet.datasets.folder import sample_images
from calibnet.datasets.images.files import read_image
from calibnet.datasets.images.lens import Lens, RectifiedImage
from calibnet.datasets.kitti.calibration import (
    IMAGE_SUFFIXES,
    frame_files,
    read_calibration_file,
    read_calibration_row,
    read_times,
    times_of,
)
from calibnet.datasets.paired import FrameFiles, PairedSequence, files_by_stem, require_folder, with_partners
from calibnet.datasets.plausibility import of_camera, of_extrinsic, refuse
from calibnet.errors import DatasetError
from calibnet.geometry import CameraModel, invert, transform
from calibnet.geometry.rectification import central
from calibnet.geometry.types import Extrinsic, Floats, Intrinsics, Transform

LAYOUT = "a KITTI-360 root holds calibration/, data_2d_raw/ and data_3d_raw/"
IMAGE_FOLDERS = {0: "data_rect", 1: "data_rect", 2: "data_rgb", 3: "data_rgb"}
"""Folder of each camera's images: rectified for the perspective cameras, original for the fisheyes."""


class Kitti360(PairedSequence):
    """One drive of KITTI-360."""

    def __init__(self, root: Path | str, drive: str | int, camera: int = 0) -> None:
        """Open a drive.

        Args:
            root: the folder that holds ``calibration``, ``data_2d_raw`` and ``data_3d_raw``.
            drive: number of the drive, ``"0003"`` or 3.
            camera: 0 or 1 (perspective), 2 or 3 (fisheye), as far as the drive has them.

        Raises:
            DatasetError: a folder or file is missing, malformed, or nothing pairs.
        """
        root = require_folder(Path(root), LAYOUT)
        if camera not in IMAGE_FOLDERS:
            raise DatasetError(f"KITTI-360 has no camera {camera}; choose 0 or 1 (perspective), 2 or 3 (fisheye).")
        scans_at = drive_folder(root / "data_3d_raw", drive)
        at = root / "data_2d_raw" / scans_at.name / f"image_0{camera}"
        present = ", ".join(sorted(path.name[-1] for path in at.parent.glob("image_0[0-3]") if path.is_dir()))
        images_at = require_folder(at / IMAGE_FOLDERS[camera], f"cameras there: {present or 'none, unpack the images'}")
        images = files_by_stem(images_at, IMAGE_SUFFIXES, "images")
        velodyne = require_folder(scans_at / "velodyne_points", LAYOUT)
        scans = files_by_stem(require_folder(velodyne / "data", LAYOUT), (".bin",), "scans")
        both, self.notes = with_partners(images, scans)
        found = camera_of(root / "calibration", camera)
        extrinsic = camera_from_lidar(root / "calibration", camera)
        where = f"Calibration of camera {camera} in {root / 'calibration'}"
        if isinstance(found, CameraModel):
            refuse([*of_camera(central(found).pinhole), *of_extrinsic(extrinsic)], where)
            self._lens: Lens | None = Lens.of(found, extrinsic, sample_images(list(both.values()), found))
            self._fixed = Calibration(self._lens.pinhole.matrix, extrinsic)
            self.notes += self._lens.notes
        else:
            self._lens, self._fixed = None, Calibration(found, extrinsic)
        files = frame_files(both, scans, _times(velodyne / "timestamps.txt", both, scans))
        number = scans_at.name.split("_")[4]
        super().__init__(f"kitti-360/{number}", f"KITTI-360, camera {camera}", files)

    def _calibration(self, files: FrameFiles) -> Calibration:
        return self._fixed

    def _image(self, files: FrameFiles) -> RectifiedImage:
        path = files.needed.image
        if self._lens is None:
            return RectifiedImage(read_image(path))
        camera = self._lens.camera
        return self._lens(read_image(path, (camera.width, camera.height)))


def drive_folder(parent: Path, drive: str | int) -> Path:
    """The folder of a drive, for instance ``2013_05_28_drive_0003_sync``.

    Raises:
        DatasetError: there is none; the message names those present.
    """
    present = {path.name.split("_")[4]: path for path in sorted(require_folder(parent, LAYOUT).glob("*_drive_*_sync"))}
    number = str(drive).zfill(4)
    if number not in present:
        raise DatasetError(f"{parent} has no drive {number}; drives there: {', '.join(present) or 'none'}.")
    return present[number]


def camera_of(folder: Path, camera: int) -> CameraModel | Intrinsics:
    """The lens of a fisheye, or the 3x3 matrix of a perspective camera, whose images are rectified.

    Raises:
        DatasetError: its file is missing or malformed.
    """
    if camera >= 2:
        path = folder / f"image_0{camera}.yaml"
        lens = read_calibration(path).camera
        if lens is None:
            raise DatasetError(f"Calibration {path} has no camera; get it from KITTI-360's calibrations.")
        return lens
    row = f"P_rect_0{camera}"
    return read_calibration_file(folder / "perspective.txt", {row: 12})[row].reshape(3, 4)[:, :3]


def camera_from_lidar(folder: Path, camera: int) -> Extrinsic:
    """The extrinsic of a camera, for a perspective one after rectification.

    ``calib_cam_to_velo.txt`` is the LiDAR from camera 0, and ``calib_cam_to_pose.txt`` the car's pose frame from each
    camera, both before rectification.

    Raises:
        DatasetError: a file is missing or malformed.
    """
    rows = read_calibration_file(folder / "calib_cam_to_pose.txt", {"image_00": 12, f"image_0{camera}": 12})
    pose_from = {name: _rigid(row) for name, row in rows.items()}
    lidar_from_camera0 = _rigid(read_calibration_row(folder / "calib_cam_to_velo.txt", 12))
    camera_from_camera0 = invert(pose_from[f"image_0{camera}"]) @ pose_from["image_00"]
    extrinsic = camera_from_camera0 @ invert(lidar_from_camera0)
    if camera >= 2:
        return extrinsic
    row = f"R_rect_0{camera}"
    rectifying = read_calibration_file(folder / "perspective.txt", {row: 9})[row].reshape(3, 3)
    return transform(rectifying, np.zeros(3)) @ extrinsic


def _rigid(row: Floats) -> Transform:
    matrix = row.reshape(3, 4)
    return transform(matrix[:, :3], matrix[:, 3])


def _times(path: Path, images: dict[str, Path], scans: dict[str, Path]) -> dict[str, float]:
    """Seconds of every image's scan, by stem."""
    times: list[float] = []
    if os.path.lexists(path):
        times = read_times(path, lambda line: datetime.datetime.fromisoformat(line[:26]).timestamp())
    seconds = times_of(scans, times, path)
    return {stem: seconds[stem] for stem in images}
