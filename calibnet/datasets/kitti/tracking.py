"""KITTI tracking: ``training/{image_02/SSSS,velodyne/SSSS,calib/SSSS.txt}``, with a calibration for each sequence."""

from __future__ import annotations

from pathlib import Path

from calibnet.datasets.calibration import Calibration
from calibnet.datasets.kitti.calibration import (
    IMAGE_SUFFIXES,
    NOMINAL_PERIOD,
    camera_folder,
    frame_files,
    frame_number,
    read_calibration_file,
    rectified_calibration,
)
from calibnet.datasets.paired import FrameFiles, PairedSequence, files_by_stem, require_folder, with_partners
from calibnet.geometry import transform


class KittiTracking(PairedSequence):
    """One sequence of KITTI tracking."""

    def __init__(self, root: Path | str, sequence: str | int, camera: int = 2, part: str = "training") -> None:
        """Open a sequence.

        Args:
            root: the folder that holds ``training``.
            sequence: number of the sequence, ``"0004"`` or 4.
            camera: 2 or 3, as far as the folder has them.
            part: ``"training"`` or ``"testing"``.

        Raises:
            DatasetError: a folder or file is missing, malformed, or nothing pairs.
        """
        sequence = str(sequence).zfill(4)
        layout = (
            "a KITTI tracking root holds training/image_02/0000, training/velodyne/0000 and training/calib/0000.txt"
        )
        folder = require_folder(require_folder(Path(root), layout) / part, layout)
        velodyne = require_folder(folder / "velodyne", layout)
        present = ", ".join(sorted(path.name for path in velodyne.iterdir() if path.is_dir()))
        scans_at = require_folder(velodyne / sequence, f"sequences there: {present or 'none'}")
        images_at = require_folder(camera_folder(folder, "image_0", camera) / sequence, layout)
        images = files_by_stem(images_at, IMAGE_SUFFIXES, "images")
        scans = files_by_stem(scans_at, (".bin",), "scans")
        images, self.notes = with_partners(images, scans)
        projection = f"P{camera}"
        rows = read_calibration_file(
            folder / "calib" / f"{sequence}.txt", {projection: 12, "R_rect": 9, "Tr_velo_cam": 12}
        )
        extrinsic = rows["Tr_velo_cam"].reshape(3, 4)
        rectifying = transform(rows["R_rect"].reshape(3, 3), [0.0, 0.0, 0.0])
        camera0_from_lidar = rectifying @ transform(extrinsic[:, :3], extrinsic[:, 3])
        self._fixed = rectified_calibration(rows[projection].reshape(3, 4), camera0_from_lidar)
        times = {stem: NOMINAL_PERIOD * frame_number(path) for stem, path in images.items()}
        files = frame_files(images, scans, times)
        super().__init__(f"kitti-tracking/{sequence}", f"KITTI tracking, camera {camera}", files)

    def _calibration(self, files: FrameFiles) -> Calibration:
        return self._fixed
