"""KITTI raw, synced and rectified drives: ``DATE/DATE_drive_NNNN_sync``.

Calibration and times are read by pykitti, which opens anything with a file's name, even if that blocks; so every file
is checked here before. Frames are listed here, since pykitti looks for one type of image only.
"""

from __future__ import annotations

import os
from datetime import datetime
from pathlib import Path
from typing import Any

import pykitti

from calibnet.datasets.calibration import Calibration
from calibnet.datasets.kitti.calibration import (
    IMAGE_SUFFIXES,
    camera_folder,
    frame_files,
    read_calibration_file,
    read_times,
    rectified_calibration,
    times_of,
)
from calibnet.datasets.paired import FrameFiles, PairedSequence, files_by_stem, require_folder, with_partners
from calibnet.errors import DatasetError
from calibnet.runtime.text import one_line

CALIBRATION_ROWS = {
    "calib_cam_to_cam.txt": {f"P_rect_0{n}": 12 for n in range(4)} | {f"R_rect_0{n}": 9 for n in range(4)},
    "calib_velo_to_cam.txt": {"R": 9, "T": 3},
    "calib_imu_to_velo.txt": {"R": 9, "T": 3},
}


class KittiRaw(PairedSequence):
    """One drive of KITTI raw."""

    def __init__(self, root: Path | str, date: str, drive: str | int, camera: int = 2) -> None:
        """Open a drive.

        Args:
            root: the folder that holds the dates.
            date: date, for instance ``"2011_09_26"``.
            drive: number of the drive, ``"0005"`` or 5.
            camera: 0 to 3, as far as the drive has them.

        Raises:
            DatasetError: a folder or file is missing, malformed, or nothing pairs.
        """
        root, drive = Path(root), str(drive).zfill(4)
        folder = _drive_folder(root, date, drive)
        images = files_by_stem(_data_folder(camera_folder(folder, "image_0", camera)), IMAGE_SUFFIXES, "images")
        scans = files_by_stem(_data_folder(folder / "velodyne_points"), (".bin",), "scans")
        paired, self.notes = with_partners(images, scans)
        for name, rows in CALIBRATION_ROWS.items():
            read_calibration_file(root / date / name, rows)
        kitti = _open(root, date, drive)
        self._fixed = rectified_calibration(
            getattr(kitti.calib, f"P_rect_{camera}0"), kitti.calib.R_rect_00 @ kitti.calib.T_cam0_velo_unrect
        )
        seconds = [(time - kitti.timestamps[0]).total_seconds() for time in kitti.timestamps]
        files = frame_files(paired, scans, times_of(images, seconds, kitti.timestamp_file))
        super().__init__(f"kitti-raw/{date}_drive_{drive}", f"KITTI {date}, camera {camera}", files)

    def _calibration(self, files: FrameFiles) -> Calibration:
        return self._fixed


class _Reader(pykitti.raw):  # type: ignore[misc]  # pykitti has no types
    """pykitti's reader without GPS/IMU packets, which accepts a drive without times."""

    @property
    def timestamp_file(self) -> Path:
        return Path(self.data_path) / "oxts" / "timestamps.txt"

    def _load_timestamps(self) -> None:
        self.timestamps: list[Any] = []
        if os.path.lexists(self.timestamp_file):  # a broken link is an error rather than a drive without times
            read_times(self.timestamp_file, lambda line: datetime.fromisoformat(line[:26]).timestamp())
            super()._load_timestamps()

    def _load_oxts(self) -> None:
        self.oxts: list[Any] = []


def _open(root: Path, date: str, drive: str) -> _Reader:
    try:
        return _Reader(str(root), date, drive)
    except ValueError as error:
        folder = root / date / f"{date}_drive_{drive}_sync" / "oxts"
        raise DatasetError(
            f"{folder / 'timestamps.txt'} or a calib_*.txt of {date} is malformed ({one_line(error, 200)}); get them "
            "from KITTI."
        ) from None


def _drive_folder(root: Path, date: str, drive: str) -> Path:
    layout = "a KITTI raw root holds DATE/calib_*.txt and DATE/DATE_drive_NNNN_sync"
    dates = [path.name for path in sorted(require_folder(root, layout).iterdir()) if path.is_dir()]
    require_folder(root / date, f"{layout}; folders there: {', '.join(dates) or 'none'}")
    drives = [path.name.split("_")[4] for path in sorted((root / date).glob("*_drive_*_sync"))]
    return require_folder(root / date / f"{date}_drive_{drive}_sync", f"drives there: {', '.join(drives) or 'none'}")


def _data_folder(folder: Path) -> Path:
    return require_folder(folder / "data", "unpack the drive's synced+rectified zip there")
