"""Finds all sequences in a dataset's folder."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from calibnet.datasets.frame import Sequence
from calibnet.datasets.registry import open_sequence


def find_sequences(dataset: str, root: Path, name: str = "") -> Iterator[Sequence]:
    """Open every sequence, with every colour camera, in the folder of a dataset.

    Args:
        dataset: a name from `dataset_names`; a dataset of another package is opened on the folder itself.
        root: the dataset's folder.
        name: name of a single sequence to open: ``DATE/DRIVE``, a number, a split, or a folder below ``root``.
    """
    if dataset in FINDERS:
        return FINDERS[dataset](root, name)
    return iter([open_sequence(dataset, root / name)])


def _raw(root: Path, name: str) -> Iterator[Sequence]:
    for folder in sorted(root.glob("*/*_sync")):
        date, drive = folder.parent.name, folder.name.removesuffix("_sync").rpartition("_")[2]
        if not name or name == f"{date}/{drive}":
            for camera in (2, 3):
                if (folder / f"image_{camera:02d}").is_dir():
                    yield open_sequence("kitti-raw", root, date=date, drive=drive, camera=camera)


def _odometry(root: Path, name: str) -> Iterator[Sequence]:
    for folder in sorted((root / "sequences").glob(name or "*")):
        for camera in (2, 3):
            if (folder / f"image_{camera}").is_dir():
                yield open_sequence("kitti-odometry", root, sequence=folder.name, camera=camera)


def _object(root: Path, name: str) -> Iterator[Sequence]:
    yield open_sequence("kitti-object", root, split=name or "train")


def _tracking(root: Path, name: str) -> Iterator[Sequence]:
    for folder in sorted((root / "training" / "velodyne").glob(name or "*")):
        for camera in (2, 3):
            if (root / "training" / f"image_0{camera}" / folder.name).is_dir():
                yield open_sequence("kitti-tracking", root, sequence=folder.name, camera=camera)


def _folder(root: Path, name: str) -> Iterator[Sequence]:
    for folder in sorted({file.parent for file in [*root.glob("calibration.yaml"), *root.glob("*/calibration.yaml")]}):
        if not name or folder.name == name:
            yield open_sequence("folder", folder)


def _kitti_360(root: Path, name: str) -> Iterator[Sequence]:
    for folder in sorted((root / "data_2d_raw").glob("*_drive_*_sync")):
        drive = folder.name.split("_")[4]
        if not name or int(name) == int(drive):
            for camera in range(4):
                if (folder / f"image_0{camera}").is_dir():
                    yield open_sequence("kitti-360", root, drive=drive, camera=camera)


def _nuscenes(root: Path, name: str) -> Iterator[Sequence]:
    """``CAM_FRONT`` of every scene; ``SCENE/CAMERA`` names another camera."""
    from calibnet.datasets.nuscenes.tables import find_tables, scene_names

    scene, _, camera = name.partition("/")
    for one in [scene] if scene else scene_names(find_tables(root)):
        yield open_sequence("nuscenes", root, scene=one, camera=camera or "CAM_FRONT")


FINDERS = {
    "kitti-360": _kitti_360,
    "nuscenes": _nuscenes,
    "kitti-raw": _raw,
    "kitti-odometry": _odometry,
    "kitti-object": _object,
    "kitti-tracking": _tracking,
    "folder": _folder,
}
