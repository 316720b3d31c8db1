"""A fleet of synthetic drives: a few streets, rendered once and reused with different calibrations."""

from __future__ import annotations

import csv
import io
import os
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from datetime import date, timedelta
from pathlib import Path
from typing import Literal

import cv2
import numpy as np
import yaml
from numpy.random import Generator

from calibnet.datasets.frame import Frame
from calibnet.datasets.synthetic import KITTI_LIKE, SyntheticSequence
from calibnet.errors import ConfigError
from calibnet.geometry import invert, miscalibration
from calibnet.geometry.types import Transform
from calibnet.runtime.writing import write_whole

Fault = Literal["none", "moved", "camera", "truncated"]
STREETS, FRAMES = 4, 4
"""Number of streets that are rendered, and of frames in each."""
DRIVES_A_CAR = 10
FIRST_DAY = date(2026, 1, 5)
SMALL_DEG, SMALL_M = 0.1, 0.01
"""Standard deviation per axis of the error of a good calibration."""
MOVED_DEG, MOVED_M = 2.0, 0.25
"""Size of a mount's move, about and along a random axis."""
FOCAL = 1.12
"""Factor by which the focal length of a wrong camera matrix is too long."""
LIST, TRUTH = "DRIVES.csv", "truth.csv"


@dataclass(frozen=True)
class Simulated:
    """A drive to be written.

    Attributes:
        car: number of the car.
        drive: number of the drive, of that car.
        street: number of the street.
        delta: error of its calibration where the mount has not moved.
        move: the mount's move, which the calibration does not know; identity for none.
        fault: what is wrong with it.
    """

    car: int
    drive: int
    street: int
    delta: Transform
    move: Transform
    fault: Fault


def simulate(
    folder: Path,
    count: int,
    seed: int,
    frames: int = FRAMES,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Path:
    """Write a fleet: ``DRIVES.csv``, the drives that it lists, and ``truth.csv`` with the fault of each.

    Args:
        folder: a new or empty folder.
        count: number of drives.
        seed: seed of the random numbers.
        frames: number of frames of each drive.
        progress: called with the number of rendered frames and the total.

    Returns:
        The list of drives.

    Raises:
        ConfigError: the folder is not empty or cannot be written.
    """
    try:
        if folder.is_dir() and any(folder.iterdir()):
            raise ConfigError(f"{folder} is not empty; give a new folder.")
        streets = min(STREETS, count)
        for street in range(streets):
            sequence = SyntheticSequence(seed * 1000 + street, frames, KITTI_LIKE)
            for position, frame in enumerate(sequence):
                _write_frame(frame, folder / "streets" / str(street))
                progress(street * frames + position + 1, streets * frames)
        fleet = draw(count, streets, np.random.default_rng([seed, 22]))
        for one in fleet:
            _write_drive(one, folder)
        write_whole(folder / TRUTH, _table(fleet, truth=True))
        write_whole(folder / LIST, _table(fleet, truth=False))
    except OSError as error:
        raise ConfigError(
            f"{error.filename or folder} cannot be written ({error.strerror}); choose another folder."
        ) from None
    return folder / LIST


def draw(count: int, streets: int, generator: Generator) -> list[Simulated]:
    """Draw the drives of a fleet.

    Of every 20 cars, one has a mount that moves and one a wrong camera matrix; some scans are cut off. A mount stays
    where it moved to, so a car's later drives are off as well.
    """
    cars = -(-count // DRIVES_A_CAR)
    order = generator.permutation(cars)
    moving, wrong = order[: max(1, cars // 20)], order[max(1, cars // 20) :][: max(1, cars // 20)]
    cut = set(generator.choice(count, max(1, count // 60), replace=False).tolist()) if count > 1 else set()
    fleet = []
    for number in range(count):
        car, drive = divmod(number, DRIVES_A_CAR)
        fault: Fault = "none"
        if number in cut:
            fault = "truncated"
        elif car in wrong:
            fault = "camera"
        elif car in moving and drive >= DRIVES_A_CAR // 2:
            fault = "moved"
        fleet.append(Simulated(car, drive, number % streets, _delta(generator), _move(car, fault), fault))
    return fleet


def _delta(generator: Generator) -> Transform:
    return miscalibration(generator.normal(0.0, SMALL_DEG, 3), generator.normal(0.0, SMALL_M, 3))


def _move(car: int, fault: Fault) -> Transform:
    if fault != "moved":
        return np.eye(4)
    moves = np.random.default_rng([car, 23])  # the same for all drives of the car
    turn, shift = moves.normal(size=3), moves.normal(size=3)
    return miscalibration(MOVED_DEG * turn / np.linalg.norm(turn), MOVED_M * shift / np.linalg.norm(shift))


def _write_frame(frame: Frame, folder: Path) -> None:
    png = cv2.imencode(".png", cv2.cvtColor(frame.image, cv2.COLOR_RGB2BGR))[1]
    write_whole(folder / "images" / f"{frame.index:04d}.png", png.tobytes())
    write_whole(folder / "clouds" / f"{frame.index:04d}.bin", frame.points.astype("<f4").tobytes())


def _write_drive(one: Simulated, folder: Path) -> None:
    """Write a plain folder with a calibration, whose frames are links into the street.

    Where the mount has moved, the scans are written as the LiDAR sees them from there.
    """
    street, drive = folder / "streets" / str(one.street), folder / _path(one)
    drive.mkdir(parents=True)
    for name in ("images", "clouds"):
        if one.fault in ("truncated", "moved") and name == "clouds":
            shutil.copytree(street / name, drive / name)
            for scan in sorted((drive / name).iterdir()):
                if one.fault == "truncated":
                    os.truncate(scan, 1001)
                else:
                    _move_scan(scan, one.move)
        else:
            (drive / name).symlink_to(Path(os.path.relpath(street / name, drive)))
    matrix = KITTI_LIKE.camera.matrix.copy()
    if one.fault == "camera":
        matrix[[0, 1], [0, 1]] *= FOCAL
    calibration = {
        "width": KITTI_LIKE.camera.width,
        "height": KITTI_LIKE.camera.height,
        "camera_matrix": matrix.tolist(),
        "distortion": [0.0] * 5,
        "camera_from_lidar": (one.delta @ KITTI_LIKE.camera_from_lidar).tolist(),
    }
    write_whole(drive / "calibration.yaml", yaml.safe_dump(calibration).encode())


def _move_scan(file: Path, move: Transform) -> None:
    """Rewrite a scan so that ``move @ camera_from_lidar`` puts its points where they were seen."""
    points = np.fromfile(file, "<f4").reshape(-1, 4)
    here = invert(move @ KITTI_LIKE.camera_from_lidar) @ KITTI_LIKE.camera_from_lidar
    points[:, :3] = points[:, :3] @ here[:3, :3].T + here[:3, 3]
    file.write_bytes(points.astype("<f4").tobytes())


def _path(one: Simulated) -> str:
    return f"drives/car-{one.car:04d}/drive-{one.drive:02d}"


def _table(fleet: list[Simulated], truth: bool) -> bytes:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["car", "drive", "fault"] if truth else ["car", "drive", "date", "path"])
    for one in fleet:
        names = [f"car-{one.car:04d}", f"drive-{one.drive:02d}"]
        day = FIRST_DAY + timedelta(weeks=one.drive)
        writer.writerow([*names, one.fault] if truth else [*names, day.isoformat(), _path(one)])
    return text.getvalue().encode()
