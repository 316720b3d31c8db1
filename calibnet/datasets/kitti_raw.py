"""KITTI raw, synced and rectified drives: ``DATE/DATE_drive_NNNN_sync``.

Read here rather than by pykitti, as in `kitti_odometry`.
"""

from __future__ import annotations

import os
from datetime import UTC, datetime
from pathlib import Path

from calibnet.datasets.calibration import Calibration
from calibnet.datasets.kitti import (
    IMAGE_SUFFIXES,
    camera_folder,
    frame_files,
    read_calibration_file,
    read_times,
    rectified_calibration,
    times_of,
)
from calibnet.datasets.paired import FrameFiles, PairedSequence, check_paired, files_by_stem, require_folder
from calibnet.geometry import transform

CALIBRATION_ROWS = {
    "calib_cam_to_cam.txt": {f"P_rect_0{n}": 12 for n in range(4)} | {f"R_rect_0{n}": 9 for n in range(4)},
    "calib_velo_to_cam.txt": {"R": 9, "T": 3},
}

KNOWN_GAPS = {"2011_09_26_drive_0009_sync": {f"{number:010d}" for number in range(177, 181)}}
"""Images whose scans KITTI itself never published, by drive; they are left out."""


class KittiRaw(PairedSequence):
    """One drive of KITTI raw."""

    def __init__(self, root: Path | str, date: str, drive: str | int, camera: int = 2) -> None:
        """Open a drive.

        Args:
            root: the folder that holds the dates.
            date: for instance ``"2011_09_26"``.
            drive: its number, ``"0005"`` or 5.
            camera: 0 to 3, as far as the drive has them.

        Raises:
            DatasetError: a folder or file is missing, malformed or does not pair.
        """
        root, drive = Path(root), str(drive).zfill(4)
        folder = _drive_folder(root, date, drive)
        images = files_by_stem(_data_folder(camera_folder(folder, "image_0", camera)), IMAGE_SUFFIXES, "images")
        scans = files_by_stem(_data_folder(folder / "velodyne_points"), (".bin",), "scans")
        without_scan = KNOWN_GAPS.get(folder.name, set()) - scans.keys()
        paired_images = {stem: image for stem, image in images.items() if stem not in without_scan}
        check_paired(paired_images, scans)
        cameras, lidar = (read_calibration_file(root / date / name, rows) for name, rows in CALIBRATION_ROWS.items())
        camera0_from_lidar = transform(lidar["R"].reshape(3, 3), lidar["T"])
        rectifying = transform(cameras["R_rect_00"].reshape(3, 3), [0.0, 0.0, 0.0])
        self._fixed = rectified_calibration(cameras[f"P_rect_0{camera}"].reshape(3, 4), rectifying @ camera0_from_lidar)
        timestamps = folder / "oxts" / "timestamps.txt"
        files = frame_files(paired_images, scans, times_of(images, _times(timestamps), timestamps))
        super().__init__(f"kitti-raw/{date}_drive_{drive}", f"KITTI {date}, camera {camera}", files)

    def _calibration(self, files: FrameFiles) -> Calibration:
        return self._fixed


def _times(path: Path) -> list[float]:
    """Seconds of every frame since the first, exact to the microsecond; none for a drive that has no times."""
    if not os.path.lexists(path):  # a link that leads nowhere is no drive without times
        return []
    times = read_times(path, lambda line: datetime.fromisoformat(line[:26]).replace(tzinfo=UTC).timestamp())
    return [round(time - times[0], 6) for time in times]


def _drive_folder(root: Path, date: str, drive: str) -> Path:
    layout = "a KITTI raw root holds DATE/calib_*.txt and DATE/DATE_drive_NNNN_sync"
    dates = [path.name for path in sorted(require_folder(root, layout).iterdir()) if path.is_dir()]
    require_folder(root / date, f"{layout}; folders there: {', '.join(dates) or 'none'}")
    drives = [path.name.split("_")[4] for path in sorted((root / date).glob("*_drive_*_sync"))]
    return require_folder(root / date / f"{date}_drive_{drive}_sync", f"drives there: {', '.join(drives) or 'none'}")


def _data_folder(folder: Path) -> Path:
    return require_folder(folder / "data", "unpack the drive's synced+rectified zip there")
