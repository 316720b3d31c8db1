"""A folder of the user's own sensors: ``images/``, ``clouds/`` and a calibration file."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calibnet.datasets.calibration import Calibration
from calibnet.datasets.calibration_files import (
    BY_NAME,
    CalibrationFile,
    FrameChoice,
    Wanted,
    names_cameras,
    read_calibration,
)
from calibnet.datasets.clouds.scans import SCAN_SUFFIXES
from calibnet.datasets.images.development import Development, Levels
from calibnet.datasets.images.files import BY_ITSELF, read_image, read_levels
from calibnet.datasets.images.lens import LOOKED_AT, Lens, RectifiedImage
from calibnet.datasets.paired import FrameFiles, PairedSequence, files_by_stem, require_folder
from calibnet.datasets.pairing import Pair, pair
from calibnet.datasets.plausibility import of_camera, of_extrinsic, of_lens, refuse
from calibnet.datasets.selection import evenly_spaced
from calibnet.errors import ConfigError, DatasetError
from calibnet.geometry.camera_model import CameraModel
from calibnet.geometry.prior import Prior, parse_angle, parse_axes, parse_length
from calibnet.geometry.rectification import central
from calibnet.geometry.types import Extrinsic
from calibnet.runtime.text import one_line

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp", ".pgm", ".ppm")
CALIBRATION_SUFFIXES = (".yaml", ".yml", ".json", ".xml")
DEPTHS_LOOKED_AT = 6
"""Number of images of a drive from which the camera's bit depth is found."""
PERIOD = 0.1
"""Seconds between two frames of a folder without times."""
FEW_NAMES = 6
"""Number of a folder's names in a message."""
LARGEST_NUMBER = 10**10
"""Smallest number in a file name that is taken for a time rather than a frame number."""


class Folder(PairedSequence):
    """Images and scans of one camera and one LiDAR, paired by file name or time."""

    def __init__(
        self,
        root: Path | str,
        guess: Path | None = None,
        camera: str | None = None,
        frames: FrameChoice = BY_NAME,
        max_time_difference: float | None = None,
        clouds: Path | None = None,
    ) -> None:
        """Open a folder.

        Args:
            root: the folder with ``images``, ``clouds`` (``.bin``, ``.npy``, ``.pcd``, ``.ply``) and
                ``calibration.yaml``, or the file of another tool, see `calibnet.datasets.calibration_files`.
            guess: a file with the initial extrinsic, instead of the one in the calibration, or if that has none.
            camera: name of the camera, in a calibration file of several cameras.
            frames: names of the coordinate frames of camera and LiDAR, in a file of several.
            max_time_difference: largest time between an image and its scan in milliseconds, see `pair`.
            clouds: folder of the scans; ``clouds`` in ``root`` by default.

        Raises:
            DatasetError: a file is missing, malformed or cannot be right, or images and scans do not pair.
        """
        root = Path(root)
        layout = "a data folder holds images/, clouds/ and calibration.yaml"
        require_folder(root, layout)
        images_at, scans_at = root / "images", root / "clouds" if clouds is None else clouds
        if not (images_at.is_dir() and scans_at.is_dir()):
            layout = f"{layout}, this one {contents(root)}"
        images = files_by_stem(require_folder(images_at, layout), IMAGE_SUFFIXES, "images")
        scans = files_by_stem(require_folder(scans_at, layout), SCAN_SUFFIXES, "scans")
        pairing = pair(images, scans, max_time_difference)
        self.calibration = read_folder(root, Wanted(camera, frames, next(iter(images.values()))), guess)
        assert self.calibration.camera is not None and self.calibration.camera_from_lidar is not None
        real, extrinsic = self.calibration.camera, self.calibration.camera_from_lidar
        refuse([*of_lens(real), *of_camera(central(real).pinhole)], f"Calibration {calibration_path(root)}")
        refuse(of_extrinsic(extrinsic), f"Calibration {guess or calibration_path(root)}")
        paths = list(images.values())
        self._development = development_of(paths, real, self.calibration.bayer)
        self._lens = Lens.of(real, extrinsic, sample_images(paths, real, self._development))
        self.cloud_columns = self.calibration.cloud_columns
        self.prior = prior_of(self.calibration, calibration_path(root))
        self._fixed = Calibration(self._lens.pinhole.matrix, extrinsic)
        files = _frames(pairing.pairs)
        name = root.resolve().name
        super().__init__(f"folder/{name}", name, files)
        self.notes = (*pairing.notes, *self._lens.notes)

    def _calibration(self, files: FrameFiles) -> Calibration:
        return self._fixed

    def _image(self, files: FrameFiles) -> RectifiedImage:
        camera = self._lens.camera
        return self._lens(read_image(files.needed.image, (camera.width, camera.height), self._development))


def contents(folder: Path) -> str:
    """The first few names in a folder, those of folders with a slash, as words."""
    paths = sorted(folder.iterdir())
    names = [f"{path.name}/" if path.is_dir() else path.name for path in paths[:FEW_NAMES]]
    return one_line(", ".join(names) or "nothing", 200) + (" and more" if len(paths) > FEW_NAMES else "")


def development_of(images: list[Path], camera: CameraModel, bayer: str | None) -> Development:
    """The conversion of a drive's images to eight bits; several are examined if they have more bits."""
    found = list[Levels]()
    for position in evenly_spaced(len(images), DEPTHS_LOOKED_AT):
        with suppress(DatasetError):  # each frame reports its own error
            found.append(read_levels(images[position], (camera.width, camera.height)))
            if found[0].dtype == np.uint8:
                break
    return Development.of(found, bayer)


def sample_images(
    images: list[Path], camera: CameraModel, development: Development = BY_ITSELF
) -> list[NDArray[np.uint8]]:
    """Some readable images spread over a drive; empty for a pinhole camera."""
    found = list[NDArray[np.uint8]]()
    for position in evenly_spaced(len(images), 0 if camera.is_pinhole else LOOKED_AT):
        with suppress(DatasetError):
            found.append(read_image(images[position], (camera.width, camera.height), development))
    return found


def calibration_path(root: Path) -> Path:
    """The calibration file of a folder: ``calibration.yaml``, or the only candidate there.

    Raises:
        DatasetError: there are several.
    """
    ours = root / "calibration.yaml"
    if ours.exists() or not root.is_dir():
        return ours
    found = sorted(path for path in root.iterdir() if _may_be_calibration(path) and path.is_file())
    if len(found) > 1:
        names = ", ".join(path.name for path in found)
        raise DatasetError(f"{root} has several files that may be its calibration ({names}); keep one of them.")
    return found[0] if found else ours


def _may_be_calibration(path: Path) -> bool:
    return path.suffix.lower() in CALIBRATION_SUFFIXES or path.name == "calib.txt"  # KITTI's


def read_folder(root: Path, wanted: Wanted, guess: Path | None = None) -> CalibrationFile:
    """The calibration of a folder, with the extrinsic from another file if given.

    Raises:
        DatasetError: it is missing, malformed, or lacks the camera or the extrinsic.
    """
    path = calibration_path(root)
    of_guess = wanted
    if guess is not None and wanted.camera is not None:  # the name applies to whichever file has several cameras
        if not names_cameras(guess):
            of_guess = replace(wanted, camera=None)
        elif not names_cameras(path):
            wanted = replace(wanted, camera=None)
    found = read_calibration(path, wanted)
    if found.camera is None:
        raise DatasetError(
            f"Calibration {path} ({found.kind}) has no camera; put the file of the camera there, and give this one "
            "with --guess."
        )
    if guess is not None:
        extrinsic = read_calibration(guess, of_guess).camera_from_lidar
        if extrinsic is None:
            raise DatasetError(f"Calibration {guess} has no pose of a LiDAR; give a file that has one with --guess.")
        found = replace(found, camera_from_lidar=extrinsic)
    if found.camera_from_lidar is None:
        raise DatasetError(
            f"Calibration {path} ({found.kind}) has no pose of the LiDAR; give a first guess with --guess FILE, "
            "or as the key 'camera_from_lidar', the 4x4 matrix that maps LiDAR points into the camera, in metres."
        )
    return found


def read_calibration_of(folder: Path) -> tuple[Path, CameraModel, Extrinsic]:
    """The calibration file of a folder, and its camera and extrinsic; the folder needs no frames.

    Raises:
        DatasetError: it is missing, malformed, or lacks the camera or the extrinsic.
    """
    at = folder / "images"
    images = (
        (path for path in sorted(at.iterdir()) if path.suffix.lower() in IMAGE_SUFFIXES) if at.is_dir() else iter(())
    )
    found = read_folder(folder, Wanted(image=next(images, None)))
    assert found.camera is not None and found.camera_from_lidar is not None
    return calibration_path(folder), found.camera, found.camera_from_lidar


def prior_of(calibration: CalibrationFile, path: Path) -> Prior:
    """The prior in a calibration file.

    Raises:
        DatasetError: it is not valid.
    """
    said = calibration.prior
    try:
        return Prior.of(
            parse_axes(said["fix"]) if "fix" in said else (),
            parse_length(said["prior_translation"]) if "prior_translation" in said else None,
            parse_angle(said["prior_rotation"]) if "prior_rotation" in said else None,
        )
    except ConfigError as error:
        raise DatasetError(f"Calibration {path}: {error}") from None


def _frames(pairs: list[Pair]) -> list[FrameFiles]:
    """The frames of pairs, numbered by their names, with their times or at intervals of `PERIOD`."""
    known = [one.seconds for one in pairs if one.seconds is not None]
    start = known[0] if len(known) == len(pairs) else None
    return [
        FrameFiles(number, PERIOD * position if start is None else (one.seconds or 0.0) - start, one.image, one.scan)
        for position, (number, one) in enumerate(zip(_numbers([one.stem for one in pairs]), pairs, strict=True))
    ]


def _numbers(stems: list[str]) -> list[int]:
    """The file names as frame numbers if they are distinct and ascending, else positions."""
    if all(stem.isdecimal() for stem in stems):
        numbers = [int(stem) for stem in stems]
        if numbers == sorted(set(numbers)) and numbers[-1] < LARGEST_NUMBER:
            return numbers
    return list(range(len(stems)))
