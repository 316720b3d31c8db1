"""Your own sensors: a folder of ``images/``, ``clouds/`` and one ``calibration.yaml``."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from calibnet.datasets.calibration import Calibration
from calibnet.datasets.folder_calibration import FolderCalibration, read_folder_calibration
from calibnet.datasets.images import read_image
from calibnet.datasets.paired import FrameFiles, PairedSequence, check_paired, files_by_stem, require_folder
from calibnet.datasets.plausibility import of_camera, of_extrinsic, refuse
from calibnet.datasets.scans import SCAN_SUFFIXES
from calibnet.errors import DatasetError

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp")
PERIOD = 0.1
"""Seconds between two frames: a plain folder records no time."""
LARGEST_NUMBER = 10**10
"""Stems from here on are clocks rather than frame numbers."""


class Folder(PairedSequence):
    """Images and scans of one camera and one LiDAR, paired by their file names without the ending."""

    def __init__(self, root: Path | str) -> None:
        """Open a folder.

        Args:
            root: the folder with ``images``, ``clouds`` (``.bin``, ``.npy``, ``.pcd``, ``.ply``) and
                ``calibration.yaml`` as `read_folder_calibration` describes it.

        Raises:
            DatasetError: one of them is missing, malformed or cannot be right, or images and scans do not pair.
        """
        root = Path(root)
        layout = "a data folder holds images/, clouds/ and calibration.yaml"
        require_folder(root, layout)
        images = files_by_stem(require_folder(root / "images", layout), IMAGE_SUFFIXES, "images")
        scans = files_by_stem(require_folder(root / "clouds", layout), SCAN_SUFFIXES, "scans")
        check_paired(images, scans)
        self._file: FolderCalibration = read_folder_calibration(root / "calibration.yaml")
        refuse(
            [*of_camera(self._file.camera), *of_extrinsic(self._file.calibration.camera_from_lidar)],
            f"Calibration {root / 'calibration.yaml'}",
        )
        files = [
            FrameFiles(number, PERIOD * position, image, scans[stem])
            for position, (number, (stem, image)) in enumerate(zip(_numbers(list(images)), images.items(), strict=True))
        ]
        name = root.resolve().name
        super().__init__(f"folder/{name}", name, files)

    def _calibration(self, files: FrameFiles) -> Calibration:
        return self._file.calibration

    def _image(self, files: FrameFiles) -> NDArray[np.uint8]:
        image = read_image(files.image)
        height, width = image.shape[:2]
        if (width, height) != (self._file.width, self._file.height):
            raise DatasetError(
                f"Image {files.image} is {width}x{height} and calibration.yaml is for {self._file.width}x"
                f"{self._file.height}; calibrate at the images' size or resize them."
            )
        if self._undistortion is None:
            return image
        return cv2.remap(image, *self._undistortion, cv2.INTER_LINEAR).astype(np.uint8, copy=False)

    @cached_property
    def _undistortion(self) -> tuple[NDArray[np.int16], NDArray[np.uint16]] | None:
        """OpenCV's fixed-point maps from rectified to distorted pixels, None without distortion."""
        if not self._file.distortion.any():
            return None
        matrix, size = self._file.calibration.matrix, (self._file.width, self._file.height)
        coarse, fine = cv2.initUndistortRectifyMap(matrix, self._file.distortion, np.eye(3), matrix, size, cv2.CV_16SC2)
        return coarse.astype(np.int16, copy=False), fine.astype(np.uint16, copy=False)


def _numbers(stems: list[str]) -> list[int]:
    """The stems as frame numbers if they are distinct and rise as numbers do, else positions."""
    if all(stem.isdecimal() for stem in stems):
        numbers = [int(stem) for stem in stems]
        if numbers == sorted(set(numbers)) and numbers[-1] < LARGEST_NUMBER:
            return numbers
    return list(range(len(stems)))
