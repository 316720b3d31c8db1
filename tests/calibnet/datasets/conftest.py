"""Tiny folders in the layout of every dataset, written by hand: what a loader must read back."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from calibnet.datasets import Sequence, open_sequence

K = np.array([[60.0, 0.0, 31.0], [0.0, 62.0, 22.5], [0.0, 0.0, 1.0]])
BASELINE = np.array([3.1, -0.25, 0.004])
"""Fourth column of the projection matrix, as KITTI's: not zero in any row."""
VELODYNE_OFFSET = np.array([0.02, -0.07, -0.3])
AXES = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])


def small_turn(angle: float, axis: int) -> np.ndarray:
    """A rotation by cv2, which the code under test does not use for it."""
    return cv2.Rodrigues(angle * np.eye(3)[axis])[0]


RECTIFYING = small_turn(0.01, 1)
VELODYNE_ROTATION = small_turn(-0.02, 0) @ AXES


@dataclass
class Layout:
    """A dataset on disk and what must come out of it."""

    open: Callable[..., Sequence]
    root: Path
    indices: list[int]
    matrix: np.ndarray
    camera_from_lidar: np.ndarray
    images: list[Path] = field(default_factory=list)
    scans: list[Path] = field(default_factory=list)
    calibration: Path | None = None
    pixels: list[np.ndarray] = field(default_factory=list)
    points: list[np.ndarray] = field(default_factory=list)
    stored: Callable[[np.ndarray], np.ndarray] = field(default=lambda points: points)
    """Points as a scan's file has them."""


def exact_extrinsic(rectifying: np.ndarray) -> np.ndarray:
    """``P [R|t]`` divided by ``K`` on the left, computed as one 3x4 product."""
    velodyne = np.vstack([np.column_stack([VELODYNE_ROTATION, VELODYNE_OFFSET]), [0.0, 0.0, 0.0, 1.0]])
    turn = np.eye(4)
    turn[:3, :3] = rectifying
    return np.vstack([np.linalg.inv(K) @ np.column_stack([K, BASELINE]) @ turn @ velodyne, [0.0, 0.0, 0.0, 1.0]])


def numbers(matrix: np.ndarray) -> str:
    return " ".join(f"{value:.17g}" for value in np.ravel(matrix))


def projections(key: str) -> list[str]:
    """Rows of four cameras; only camera 2 is the one of ``K``."""
    other = np.column_stack([K, [-1.0, 0.0, 0.0]])
    return [f"{key.format(n)}: {numbers(np.column_stack([K, BASELINE]) if n == 2 else other)}" for n in range(4)]


def write_frames(layout: Layout, images: Path, scans: Path, stems: list[str], suffix: str = "png") -> None:
    generator = np.random.default_rng(7)
    images.mkdir(parents=True, exist_ok=True)
    scans.mkdir(parents=True, exist_ok=True)
    for stem in stems:
        rgb = cv2.resize(generator.integers(0, 256, (6, 8, 3), dtype=np.uint8), (64, 48))
        points = generator.uniform([2, -8, -2, 0], [30, 8, 2, 1], (200, 4)).astype(np.float32)
        cv2.imwrite(str(images / f"{stem}.{suffix}"), rgb[..., ::-1])
        points.tofile(scans / f"{stem}.bin")
        layout.images.append(images / f"{stem}.{suffix}")
        layout.scans.append(scans / f"{stem}.bin")
        layout.pixels.append(rgb)
        layout.points.append(points)


def opener(name: str, root: Path, **defaults: Any) -> Callable[..., Sequence]:
    return lambda **options: open_sequence(name, root, **{**defaults, **options})


def write_kitti_odometry(root: Path) -> Layout:
    folder = root / "sequences" / "04"
    layout = Layout(opener("kitti-odometry", root, sequence="04"), root, [0, 1, 2], K, exact_extrinsic(np.eye(3)))
    write_frames(layout, folder / "image_2", folder / "velodyne", ["000000", "000001", "000002"])
    layout.calibration = folder / "calib.txt"
    velodyne = np.column_stack([VELODYNE_ROTATION, VELODYNE_OFFSET])
    layout.calibration.write_text("\n".join([*projections("P{}"), f"Tr: {numbers(velodyne)}"]) + "\n")
    (folder / "times.txt").write_text("0.0\n0.104\n0.207\n")
    return layout


def write_kitti_raw(root: Path) -> Layout:
    date = root / "2011_01_02"
    drive = date / "2011_01_02_drive_0007_sync"
    options = {"date": "2011_01_02", "drive": "0007"}
    layout = Layout(opener("kitti-raw", root, **options), root, [3, 6, 9], K, exact_extrinsic(RECTIFYING))
    stems = ["0000000003", "0000000006", "0000000009"]
    write_frames(layout, drive / "image_02" / "data", drive / "velodyne_points" / "data", stems)
    layout.calibration = date / "calib_cam_to_cam.txt"
    rotations = [f"R_rect_0{n}: {numbers(RECTIFYING if n == 0 else small_turn(0.1, 2))}" for n in range(4)]
    layout.calibration.write_text("\n".join([*projections("P_rect_0{}"), *rotations]) + "\n")
    (date / "calib_velo_to_cam.txt").write_text(
        f"calib_time: 15-Mar-2012 11:37:16\nR: {numbers(VELODYNE_ROTATION)}\nT: {numbers(VELODYNE_OFFSET)}\n"
    )
    (date / "calib_imu_to_velo.txt").write_text(f"R: {numbers(np.eye(3))}\nT: 0 0 0\n")
    (drive / "oxts").mkdir()
    (drive / "oxts" / "timestamps.txt").write_text("".join(f"2011-01-02 10:00:0{n}.250000000\n" for n in range(3)))
    return layout


def write_kitti_object(root: Path) -> Layout:
    folder = root / "training"
    layout = Layout(opener("kitti-object", root), root, [1, 5, 8], K, exact_extrinsic(RECTIFYING))
    write_frames(layout, folder / "image_2", folder / "velodyne", ["000001", "000005", "000008"])
    (folder / "calib").mkdir()
    velodyne = np.column_stack([VELODYNE_ROTATION, VELODYNE_OFFSET])
    rows = [*projections("P{}"), f"R0_rect: {numbers(RECTIFYING)}", f"Tr_velo_to_cam: {numbers(velodyne)}"]
    for image in layout.images:
        (folder / "calib" / f"{image.stem}.txt").write_text("\n".join(rows) + "\n\n")
    layout.calibration = folder / "calib" / "000005.txt"
    (root / "ImageSets").mkdir()
    (root / "ImageSets" / "val.txt").write_text("000008\n000001\n")
    return layout


def write_kitti_tracking(root: Path) -> Layout:
    folder = root / "training"
    layout = Layout(opener("kitti-tracking", root, sequence=7), root, [0, 1, 2], K, exact_extrinsic(RECTIFYING))
    write_frames(layout, folder / "image_02" / "0007", folder / "velodyne" / "0007", ["000000", "000001", "000002"])
    (folder / "calib").mkdir()
    velodyne = np.column_stack([VELODYNE_ROTATION, VELODYNE_OFFSET])
    rows = [*projections("P{}"), f"R_rect {numbers(RECTIFYING)}", f"Tr_velo_cam {numbers(velodyne)}"]
    layout.calibration = folder / "calib" / "0007.txt"
    layout.calibration.write_text("\n".join(rows) + "\n")
    return layout


def folder_calibration(**changes: Any) -> str:
    values = {
        "width": 64,
        "height": 48,
        "camera_matrix": K.tolist(),
        "distortion": [0.0] * 5,
        "camera_from_lidar": exact_extrinsic(np.eye(3)).tolist(),
        "note": "'ignored: yes'",
    }
    return "\n".join(f"{key}: {value}" for key, value in {**values, **changes}.items() if value is not None) + "\n"


def write_folder(root: Path) -> Layout:
    layout = Layout(opener("folder", root), root, [0, 1, 2], K, exact_extrinsic(np.eye(3)))
    write_frames(layout, root / "images", root / "clouds", ["0000", "0001", "0002"])
    layout.calibration = root / "calibration.yaml"
    layout.calibration.write_text(folder_calibration())
    return layout


def write_kitti_360(root: Path) -> Layout:
    from tests.calibnet.datasets import published  # which is made of what is above

    return published.write_kitti_360(root)


def write_nuscenes(root: Path) -> Layout:
    from tests.calibnet.datasets import published

    return published.write_nuscenes(root)


LAYOUTS: dict[str, Callable[[Path], Layout]] = {
    "kitti-odometry": write_kitti_odometry,
    "kitti-raw": write_kitti_raw,
    "kitti-object": write_kitti_object,
    "kitti-tracking": write_kitti_tracking,
    "kitti-360": write_kitti_360,
    "nuscenes": write_nuscenes,
    "folder": write_folder,
}
"""One line a dataset of the registry; the protocol's test fails for a dataset without one."""


@pytest.fixture
def write_layout(tmp_path: Path) -> Callable[[str], Layout]:
    """Write the folder of a dataset by name, below a path of the kind that trips globs and formats."""
    return lambda name: LAYOUTS[name](tmp_path / "my [data] 100%")


@pytest.fixture
def write_calibration() -> Callable[..., str]:
    """The text of a ``calibration.yaml`` with some values changed, or left out (None)."""
    return folder_calibration
