"""KITTI odometry: ``sequences/SS/{calib.txt,times.txt,image_N,velodyne}``.

Calibration and times come through pykitti. The files are listed here, because pykitti looks for
one image type at a time and finds nothing below a path with brackets.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pykitti

from calibnet.datasets.calibration import Calibration
from calibnet.datasets.kitti import (
    DATE_OF_FOCAL_LENGTH,
    IMAGE_SUFFIXES,
    camera_folder,
    frame_files,
    read_calibration_file,
    rectified_calibration,
    times_of,
)
from calibnet.datasets.paired import FrameFiles, PairedSequence, check_paired, files_by_stem, require_folder
from calibnet.errors import DatasetError

CALIBRATION_ROWS = {"P0": 12, "P1": 12, "P2": 12, "P3": 12, "Tr": 12}


class KittiOdometry(PairedSequence):
    """One sequence of KITTI odometry, or of any folder in its layout."""

    def __init__(self, root: Path | str, sequence: str | int, camera: int = 2) -> None:
        """Open a sequence.

        Args:
            root: the folder that holds ``sequences``.
            sequence: its number, ``"04"`` or 4.
            camera: 0 to 3, as far as the folder has them.

        Raises:
            DatasetError: a folder or file is missing, malformed or does not pair.
        """
        sequence = str(sequence).zfill(2)
        folder = _sequence_folder(Path(root), sequence)
        images = files_by_stem(camera_folder(folder, "image_", camera), IMAGE_SUFFIXES, "images")
        velodyne = require_folder(folder / "velodyne", "unpack KITTI's velodyne zip there")
        scans = files_by_stem(velodyne, (".bin",), "scans")
        check_paired(images, scans)
        read_calibration_file(folder / "calib.txt", CALIBRATION_ROWS)
        kitti = _open(Path(root), sequence)
        projection = getattr(kitti.calib, f"P_rect_{camera}0")
        self._fixed = rectified_calibration(projection, kitti.calib.T_cam0_velo)
        seconds = [time.total_seconds() for time in kitti.timestamps]
        files = frame_files(images, scans, times_of(images, seconds, folder / "times.txt"))
        date = DATE_OF_FOCAL_LENGTH.get(float(self._fixed.matrix[0, 0]))
        rig = f"KITTI {date}" if date else f"KITTI odometry layout, sequence {sequence}"
        super().__init__(f"kitti-odometry/{sequence}", f"{rig}, camera {camera}", files)

    def _calibration(self, files: FrameFiles) -> Calibration:
        return self._fixed


class _Reader(pykitti.odometry):  # type: ignore[misc]  # pykitti has no types
    """pykitti's reader without the poses: calibration needs none, and some sequences have none."""

    def _load_poses(self) -> None:
        self.poses: list[np.ndarray] = []


def _open(root: Path, sequence: str) -> _Reader:
    times = root / "sequences" / sequence / "times.txt"
    try:
        return _Reader(str(root), sequence)
    except FileNotFoundError as error:
        raise DatasetError(f"{error.filename} does not exist; get it from KITTI's calib zip.") from None
    except ValueError as error:
        raise DatasetError(
            f"{times} or calib.txt beside it is malformed ({error}); get both from KITTI's calib zip."
        ) from None


def _sequence_folder(root: Path, sequence: str) -> Path:
    remedy = "a KITTI odometry root holds sequences/00 to 21, each with calib.txt, times.txt, image_2 and velodyne"
    require_folder(root, remedy)
    present = sorted(path.name for path in require_folder(root / "sequences", remedy).iterdir() if path.is_dir())
    return require_folder(root / "sequences" / sequence, f"sequences there: {', '.join(present) or 'none'}")
