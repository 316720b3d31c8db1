"""Functions shared by KITTI's layouts: calibration files, the exact extrinsic, cameras and times."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from calibnet.datasets.calibration import Calibration, checked_intrinsics, checked_rotation
from calibnet.datasets.paired import FrameFiles
from calibnet.errors import DatasetError
from calibnet.geometry.types import Extrinsic, Floats
from calibnet.runtime.reading import read_lines, read_text

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg")
NOMINAL_PERIOD = 0.1
"""Seconds between two frames at KITTI's 10 Hz, for frames without a recorded time."""

LATEST_S = 1e11
"""Largest time in seconds since 1970, in the year 5138."""

DATE_OF_FOCAL_LENGTH = {721.5377: "2011_09_26", 707.0912: "2011_09_30", 718.856: "2011_10_03"}
"""Recording date, and so the rig, by rectified focal length, since odometry folders do not name the date."""


def read_calibration_file(path: Path, sizes: Mapping[str, int]) -> dict[str, Floats]:
    """Read the rows ``key: numbers`` of a KITTI calibration file.

    Args:
        path: the file.
        sizes: the keys to read and how many numbers each has: 12 for a projection matrix (``P...``)
            or a rigid transform, 9 for a rotation, 3 for a translation.

    Raises:
        DatasetError: the file or a key is missing, a row has another count or numbers that are not finite, or its
            matrix is singular or not a rotation.
    """
    lines = read_text(path, "Calibration", remedy="get it from KITTI's calib zip").split("\n")
    rows: dict[str, list[str]] = {}
    for line in lines:
        key, colon, text = line.partition(":")
        if not colon:  # KITTI tracking omits it after some names
            key, colon, text = line.strip().partition(" ")
        name = key.strip()
        if colon and rows.setdefault(name, text.split()) != text.split() and name in sizes:
            raise DatasetError(f"Calibration {path} has two rows {name!r}; keep the right one.")
    values = {}
    for key, size in sizes.items():
        if key not in rows:
            raise DatasetError(f"Calibration {path} has no row {key!r}; get the file from KITTI's calib zip.")
        try:
            row = np.array(rows[key], dtype=np.float64)
        except ValueError:
            row = np.array([np.nan])
        if not np.isfinite(row).all():
            raise DatasetError(f"Calibration {path}: row {key!r} does not have finite numbers; correct it.")
        if row.size != size:
            raise DatasetError(f"Calibration {path}: row {key!r} has {row.size} numbers instead of {size}; correct it.")
        if size in (9, 12):
            check = checked_intrinsics if key.startswith("P") else checked_rotation
            check(row.reshape(3, -1)[:, :3], path, key)
        values[key] = row
    return values


def read_calibration_row(path: Path, size: int) -> Floats:
    """Read a KITTI calibration file of one row of numbers without a name; 12 numbers must be a rigid transform.

    Raises:
        DatasetError: the file is missing, or has other content.
    """
    remedy = "get it from KITTI's calibration"
    try:
        row = np.array(read_text(path, "Calibration", remedy=remedy).split(), dtype=np.float64)
    except ValueError:
        row = np.zeros(0)
    if row.size != size or not np.isfinite(row).all():
        raise DatasetError(f"Calibration {path} is not one row of {size} finite numbers; {remedy}.")
    if size == 12:
        checked_rotation(row.reshape(3, 4)[:, :3], path, path.stem)
    return row


def rectified_calibration(projection: Floats, camera0_from_lidar: Extrinsic) -> Calibration:
    """The exact calibration of a rectified camera.

    Args:
        projection: 3x4, from the rectified reference camera 0 to the pixels of this camera.
        camera0_from_lidar: 4x4, into the rectified reference camera.

    KITTI's cameras are offset in all three axes, by ``K^-1 P[:, 3]``; pykitti keeps x only.
    """
    matrix = projection[:, :3].copy()
    camera_from_lidar = camera0_from_lidar.copy()
    camera_from_lidar[:3, 3] += np.linalg.solve(matrix, projection[:, 3])
    return Calibration(matrix, camera_from_lidar)


def camera_folder(parent: Path, prefix: str, camera: int) -> Path:
    """The folder ``prefix`` + number of a camera's images, for instance ``image_2``.

    Raises:
        DatasetError: KITTI has no such camera, or the folder is missing; the message names those present.
    """
    folder = parent / f"{prefix}{camera}"
    if camera not in range(4) or not folder.is_dir():
        present = ", ".join(sorted(path.name[-1] for path in parent.glob(f"{prefix}[0-3]") if path.is_dir()))
        raise DatasetError(
            f"{folder} does not exist, so there is no camera {camera}; "
            f"cameras there: {present or 'none, unpack the images'}."
        )
    return folder


def read_times(path: Path, seconds: Callable[[str], float]) -> list[float]:
    """The times of a drive's frames, in seconds.

    Args:
        path: the file, with one time per line.
        seconds: converts a line to seconds; raises ``ValueError`` if it is not a time.

    Raises:
        DatasetError: the file is missing, or a line is not a time.
    """
    remedy = "get it from KITTI"
    times = []
    for number, line in enumerate(read_lines(path, "List of times", remedy), start=1):
        if not line.strip():
            continue
        try:
            times.append(round(seconds(line), 6))
        except (ValueError, OverflowError):
            times.append(math.nan)
        if not abs(times[-1]) < LATEST_S:
            raise DatasetError(f"List of times {path}: line {number} is not a time ({line[:40]!r}); {remedy}.")
    return times


def times_of(files: Mapping[str, Path], times: Sequence[float], path: Path) -> dict[str, float]:
    """Seconds of every file, by stem.

    ``times`` has one entry per file or, if only a part of the frames was kept, one for every file number of the whole
    drive; otherwise, KITTI's nominal 10 Hz are used.

    Raises:
        DatasetError: there are fewer times than files; the message names ``path``, the file of times.
    """
    numbers = [frame_number(file) for file in files.values()]
    if 0 < len(times) < len(numbers):
        raise DatasetError(f"{path} has {len(times)} times for {len(numbers)} frames; get the whole file from KITTI.")
    if len(times) == len(numbers):
        seconds = list(times)
    elif len(times) > max(numbers):
        seconds = [times[number] for number in numbers]
    else:
        seconds = [NOMINAL_PERIOD * number for number in numbers]
    return dict(zip(files, seconds, strict=True))


def frame_files(images: Mapping[str, Path], scans: Mapping[str, Path], times: Mapping[str, float]) -> list[FrameFiles]:
    """The frames of paired images and scans, by stem, in the order of ``images``."""
    start = times[next(iter(images))]
    return [FrameFiles(frame_number(image), times[stem] - start, image, scans[stem]) for stem, image in images.items()]


def frame_number(path: Path) -> int:
    """The number that a KITTI file is named by.

    Raises:
        DatasetError: its name is not a number.
    """
    if not path.stem.isdecimal():
        raise DatasetError(f"The name of {path} is not a number like KITTI's 000000.png; rename or remove it.")
    return int(path.stem)
