"""Writes a synthetic drive in KITTI odometry's layout, so that everything reads it like real data."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from calibnet.datasets.frame import Frame
from calibnet.datasets.synthetic.sequence import SyntheticSequence
from calibnet.errors import DatasetError
from calibnet.geometry import invert
from calibnet.geometry.types import Floats, Transform
from calibnet.runtime.writing import Kind, write_whole


def write_kitti_odometry(
    sequence: SyntheticSequence, root: Path | str, number: str = "00", progress: Callable[[int], None] | None = None
) -> Path:
    """Write ``sequences/NN/{calib.txt,times.txt,image_2,velodyne}`` and ``poses/NN.txt`` below ``root``.

    All four projection matrices are that of the one camera, without an offset, and ``Tr`` is the exact
    extrinsic: a reader gets it back to the last digit.

    Args:
        sequence: the drive; rendered here, one frame at a time.
        root: folder of the dataset; made if missing.
        number: name of the sequence, two digits.
        progress: called with the number of frames written so far.

    Returns:
        The folder of the sequence.

    Raises:
        DatasetError: the folder cannot be written.
    """
    folder = Path(root) / "sequences" / number
    poses = Path(root) / "poses" / f"{number}.txt"
    try:
        for path in (folder / "image_2", folder / "velodyne", poses.parent):
            path.mkdir(parents=True, exist_ok=True)
        times = []
        for written, frame in enumerate(sequence, start=1):
            _write_frame(frame, folder)
            times.append(f"{frame.timestamp:e}")
            if progress:
                progress(written)
        projection = np.column_stack([sequence.mount.camera.matrix, np.zeros(3)])
        extrinsic = sequence.mount.camera_from_lidar[:3]
        rows = [*(f"P{camera}: {_numbers(projection)}" for camera in range(4)), f"Tr: {_numbers(extrinsic)}"]
        write_whole(folder / "calib.txt", ("\n".join(rows) + "\n").encode())
        write_whole(folder / "times.txt", ("\n".join(times) + "\n").encode())
        write_whole(poses, ("\n".join(_numbers(pose[:3]) for pose in _camera_poses(sequence)) + "\n").encode())
    except OSError as error:
        where = error.filename or folder
        raise DatasetError(f"{where} cannot be written ({error.strerror}); choose another folder.") from None
    return folder


def _write_frame(frame: Frame, folder: Path) -> None:
    import cv2

    stem = f"{frame.index:06d}"
    png = cv2.imencode(".png", cv2.cvtColor(frame.image, cv2.COLOR_RGB2BGR))[1]
    write_whole(folder / "image_2" / f"{stem}.png", png.tobytes(), Kind.PNG)
    write_whole(folder / "velodyne" / f"{stem}.bin", frame.points.astype("<f4").tobytes())


def _camera_poses(sequence: SyntheticSequence) -> list[Transform]:
    """Every ``camera0_from_camera``, as KITTI's ground truth: relative to the first frame."""
    vehicle_from_camera = sequence.mount.vehicle_from_lidar @ invert(sequence.mount.camera_from_lidar)
    world = [sequence.world_from_vehicle(position) @ vehicle_from_camera for position in range(len(sequence))]
    return [invert(world[0]) @ pose for pose in world]


def _numbers(matrix: Floats) -> str:
    return " ".join(f"{value:.17g}" for value in np.ravel(matrix))
