"""Recognises calibration files by their content rather than their names."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from calibnet.datasets.calibration_files import kalibr, kitti, koide, launch, mei, opencv, ours, ros, transforms
from calibnet.datasets.calibration_files.calibration_file import CalibrationFile, Wanted
from calibnet.datasets.calibration_files.text import parse
from calibnet.errors import DatasetError

NOTHING_WANTED = Wanted()


def read_calibration(path: Path, wanted: Wanted = NOTHING_WANTED) -> CalibrationFile:
    """Read a calibration file.

    Supports our ``calibration.yaml``, ROS's ``camera_info``, Kalibr's ``camchain``, OpenCV's ``FileStorage``,
    CamOdoCal's (KITTI-360's fisheyes), KITTI's ``calib.txt``, koide3's ``calib.json``, lists of transforms such as
    ``/tf_static``, launch files, URDF, and Autoware's.

    Args:
        path: the file.
        wanted: selection from a file of several sensors.

    Raises:
        DatasetError: it cannot be read or used; the message names it.
    """
    content, of_opencv = parse(path)
    if wanted.camera is not None and not _names_cameras(content):
        raise DatasetError(
            f"Calibration {path} has one camera, which is not called {wanted.camera}; leave --camera out."
        )
    if launch.is_known(content):
        content = launch.transforms_of(content, path)
    if transforms.is_list(content):
        return transforms.read_list(content, path, wanted)
    if koide.is_known(content):
        return koide.read(content, path, wanted)
    if kalibr.is_known(content):
        return kalibr.read(content, path, wanted)
    if kitti.is_known(content):
        return kitti.read(content, path, wanted)
    if mei.is_known(content):
        return mei.read(content, path)
    if opencv.is_known(content, of_opencv):
        return opencv.read(content, path, wanted)
    if ros.is_known(content):
        return ros.read(content, path)
    if transforms.is_autoware(content):
        return transforms.read_autoware(content, path, wanted)
    if not isinstance(content, Mapping):
        raise DatasetError(
            f"Calibration {path} has no 'key: value' lines; write it as described in docs/own-sensors.md."
        )
    return ours.read(content, path)


def names_cameras(path: Path) -> bool:
    """Whether a file is of a kind with several cameras, of which one has to be selected.

    Raises:
        DatasetError: it cannot be read.
    """
    return _names_cameras(parse(path).content)


def _names_cameras(content: object) -> bool:
    return kalibr.is_known(content) or kitti.is_known(content)
