"""KITTI object detection: ``training/{image_2,velodyne,calib}``, every frame with its own calibration."""

from __future__ import annotations

from pathlib import Path

from calibnet.datasets.calibration import Calibration
from calibnet.datasets.kitti.calibration import (
    IMAGE_SUFFIXES,
    NOMINAL_PERIOD,
    camera_folder,
    frame_files,
    read_calibration_file,
    rectified_calibration,
)
from calibnet.datasets.paired import FrameFiles, PairedSequence, files_by_stem, require_folder, with_partners
from calibnet.errors import DatasetError
from calibnet.geometry import transform
from calibnet.runtime.reading import read_lines

PARTS = ("training", "testing")


class KittiObject(PairedSequence):
    """The frames of KITTI object detection, which are not in temporal order."""

    def __init__(self, root: Path | str, split: str = "training", camera: int = 2) -> None:
        """Open a split.

        Args:
            root: the folder that holds ``training`` (and ``ImageSets`` if lists are used).
            split: ``"training"`` or ``"testing"`` for that whole folder, or the name of a list
                ``ImageSets/SPLIT.txt`` of frames of ``training``, for instance ``"val"``.
            camera: 2, or another whose images are there.

        Raises:
            DatasetError: a folder or file is missing, or nothing pairs.
        """
        root = Path(root)
        layout = "a KITTI object root holds training/image_2, training/velodyne and training/calib"
        folder = require_folder(require_folder(root, layout) / (split if split in PARTS else "training"), layout)
        images = files_by_stem(camera_folder(folder, "image_", camera), IMAGE_SUFFIXES, "images")
        scans = files_by_stem(require_folder(folder / "velodyne", layout), (".bin",), "scans")
        self._calibrations = require_folder(folder / "calib", layout)
        self._camera = camera
        if split not in PARTS:
            stems = _listed(root / "ImageSets", split)
            images = {stem: images[stem] for stem in stems if stem in images}
            scans = {stem: scans[stem] for stem in stems if stem in scans}
            for stem in stems:
                if stem not in images and stem not in scans:
                    raise DatasetError(
                        f"{root / 'ImageSets' / split}.txt lists {stem[:60]!r}, which {folder} does not have; "
                        "get the frame or remove it from the list."
                    )
        images, self.notes = with_partners(images, scans)
        times = {stem: NOMINAL_PERIOD * position for position, stem in enumerate(images)}
        files = frame_files(images, scans, times)
        super().__init__(f"kitti-object/{split}", f"KITTI object detection, camera {camera}", files)

    def _calibration(self, files: FrameFiles) -> Calibration:
        path = self._calibrations / f"{files.needed.image.stem}.txt"
        projection = f"P{self._camera}"
        rows = read_calibration_file(path, {projection: 12, "R0_rect": 9, "Tr_velo_to_cam": 12})
        velodyne = rows["Tr_velo_to_cam"].reshape(3, 4)
        rectifying = transform(rows["R0_rect"].reshape(3, 3), [0.0, 0.0, 0.0])
        camera0_from_lidar = rectifying @ transform(velodyne[:, :3], velodyne[:, 3])
        return rectified_calibration(rows[projection].reshape(3, 4), camera0_from_lidar)


def _listed(folder: Path, split: str) -> list[str]:
    path = folder / f"{split}.txt"
    if not path.exists():
        present = ", ".join([*PARTS, *(file.stem for file in sorted(folder.glob("*.txt")))])
        raise DatasetError(f"{path} does not exist, so there is no split {split!r}; splits there: {present}.")
    stems = [stem for line in read_lines(path, "List of frames") for stem in line.split()]
    if not stems:
        raise DatasetError(f"{path} is empty; list one frame per line, for instance 000007.")
    return stems
