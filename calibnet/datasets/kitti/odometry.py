"""KITTI odometry: ``sequences/SS/{calib.txt,times.txt,image_N,velodyne}``.

Not read by pykitti, which opens anything with a file's name, even if that blocks.
"""

from __future__ import annotations

import os
from pathlib import Path

from calibnet.datasets.calibration import Calibration
from calibnet.datasets.kitti.calibration import (
    DATE_OF_FOCAL_LENGTH,
    IMAGE_SUFFIXES,
    camera_folder,
    frame_files,
    read_calibration_file,
    read_times,
    rectified_calibration,
    times_of,
)
from calibnet.datasets.paired import FrameFiles, PairedSequence, files_by_stem, require_folder, with_partners
from calibnet.geometry import transform


class KittiOdometry(PairedSequence):
    """One sequence of KITTI odometry, or of any folder in its layout: the camera's ``P`` and ``Tr`` are enough."""

    def __init__(self, root: Path | str, sequence: str | int, camera: int = 2) -> None:
        """Open a sequence.

        Args:
            root: the folder that holds ``sequences``.
            sequence: number of the sequence, ``"04"`` or 4.
            camera: 0 to 3, as far as the folder has them.

        Raises:
            DatasetError: a folder or file is missing, malformed, or nothing pairs.
        """
        sequence = str(sequence).zfill(2)
        folder = _sequence_folder(Path(root), sequence)
        images = files_by_stem(camera_folder(folder, "image_", camera), IMAGE_SUFFIXES, "images")
        velodyne = require_folder(folder / "velodyne", "unpack KITTI's velodyne zip there")
        scans = files_by_stem(velodyne, (".bin",), "scans")
        paired, self.notes = with_partners(images, scans)
        rows = read_calibration_file(folder / "calib.txt", {f"P{camera}": 12, "Tr": 12})
        camera0_from_lidar = rows["Tr"].reshape(3, 4)
        self._fixed = rectified_calibration(
            rows[f"P{camera}"].reshape(3, 4), transform(camera0_from_lidar[:, :3], camera0_from_lidar[:, 3])
        )
        times = folder / "times.txt"
        # own data may have no times; a broken link is an error
        seconds = read_times(times, float) if os.path.lexists(times) else []
        files = frame_files(paired, scans, times_of(images, seconds, times))
        date = DATE_OF_FOCAL_LENGTH.get(float(self._fixed.matrix[0, 0]))
        rig = f"KITTI {date}" if date else f"KITTI odometry layout, sequence {sequence}"
        super().__init__(f"kitti-odometry/{sequence}", f"{rig}, camera {camera}", files)

    def _calibration(self, files: FrameFiles) -> Calibration:
        return self._fixed


def _sequence_folder(root: Path, sequence: str) -> Path:
    remedy = "a KITTI odometry root holds sequences/00 to 21, each with calib.txt, times.txt, image_2 and velodyne"
    require_folder(root, remedy)
    present = sorted(path.name for path in require_folder(root / "sequences", remedy).iterdir() if path.is_dir())
    return require_folder(root / "sequences" / sequence, f"sequences there: {', '.join(present) or 'none'}")
