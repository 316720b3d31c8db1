"""nuScenes by its published tables, without its SDK: one camera and the LiDAR in one scene.

A keyframe is an image and a sweep of one sample. The two are up to 50 ms apart, in which the car moves; both poses of
the car are in the tables, so the points are moved to the time of the image.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calibnet.datasets.calibration import Calibration
from calibnet.datasets.images.files import read_image
from calibnet.datasets.images.lens import RectifiedImage
from calibnet.datasets.nuscenes.tables import (
    LIDAR,
    Pair,
    Sensor,
    chosen_scene,
    find_tables,
    read_pairs,
    read_poses,
    read_sensors,
)
from calibnet.datasets.paired import FrameFiles, PairedSequence, require_folder
from calibnet.errors import DatasetError
from calibnet.geometry import invert, transform, transform_points
from calibnet.geometry.types import Transform

OURS_FROM_THEIRS = transform([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]], [0.0, 0.0, 0.0])
"""Rotation to our axes; nuScenes's LiDAR has x to the right and y ahead."""


class NuScenes(PairedSequence):
    """The keyframes of one camera in one scene of nuScenes."""

    cloud_columns = ("x", "y", "z", "intensity", "ring")

    def __init__(
        self, root: Path | str, scene: str = "", camera: str = "CAM_FRONT", version: str = "", compensate: bool = True
    ) -> None:
        """Open a scene.

        Args:
            root: the folder that holds ``samples`` and the folder of the tables, for instance ``v1.0-mini``.
            scene: name of the scene, ``"scene-0061"``, or its number; the first one by default.
            camera: channel of the camera.
            version: folder of the tables; the only one by default.
            compensate: whether to move the points to the time of the image, by the car's poses.

        Raises:
            DatasetError: a table is missing or malformed, or there is no such scene or camera.
        """
        root = require_folder(Path(root), "a nuScenes root holds samples/ and tables such as v1.0-mini/")
        tables = find_tables(root, version)
        scene, samples = chosen_scene(tables, scene)
        sensors = read_sensors(tables)
        pairs = read_pairs(tables, root, sensors, camera, samples)
        if not pairs:
            channels = sorted({one.channel for one in sensors.values() if one.matrix is not None})
            raise DatasetError(
                f"{tables} has no keyframe of {camera} and {LIDAR} in {scene}; cameras of all scenes: "
                f"{', '.join(channels)}."
            )
        poses = read_poses(tables, {taken.pose for pair in pairs for taken in pair}) if compensate else None
        self._pairs = dict(enumerate(pairs))
        self._motions = {index: _motion(pair, sensors, poses) for index, pair in self._pairs.items()}
        self._calibrations = {pair.image.sensor: _calibration(pair, sensors) for pair in pairs}
        if compensate:
            apart = max(abs(pair.image.seconds - pair.sweep.seconds) for pair in pairs)
            self.notes = (
                f"Scans are moved to the time of their images, by up to {1e3 * apart:.0f} ms of the car's motion.",
            )
        start = pairs[0].image.seconds
        files = [
            FrameFiles(index, pair.image.seconds - start, pair.image.file, pair.sweep.file)
            for index, pair in self._pairs.items()
        ]
        super().__init__(f"nuscenes/{scene}", f"nuScenes, {camera}", files)

    def _calibration(self, files: FrameFiles) -> Calibration:
        return self._calibrations[self._pairs[files.index].image.sensor]

    def _image(self, files: FrameFiles) -> RectifiedImage:
        size = self._pairs[files.index].image.size
        return RectifiedImage(read_image(files.needed.image, size if all(size) else None))

    def _points(self, files: FrameFiles) -> NDArray[np.float32]:
        points = super()._points(files)
        moved = transform_points(self._motions[files.index], points[:, :3].astype(np.float64))
        return np.column_stack([moved, points[:, 3]]).astype(np.float32)


def _motion(pair: Pair, sensors: dict[str, Sensor], poses: dict[str, Transform] | None) -> Transform:
    """4x4, from the points of a sweep's file to our axes at the time of the image or, without poses, of the sweep."""
    if poses is None:
        return OURS_FROM_THEIRS
    if np.array_equal(poses[pair.image.pose], poses[pair.sweep.pose]):
        return OURS_FROM_THEIRS  # an exact permutation of axes
    car_from_lidar = sensors[pair.sweep.sensor].car_from_sensor
    world_from_lidar, world_from_later = (poses[taken.pose] @ car_from_lidar for taken in (pair.sweep, pair.image))
    return OURS_FROM_THEIRS @ invert(world_from_later) @ world_from_lidar


def _calibration(pair: Pair, sensors: dict[str, Sensor]) -> Calibration:
    """The calibration of the camera, with the LiDAR in our axes.

    Raises:
        DatasetError: the camera has no matrix.
    """
    camera, lidar = sensors[pair.image.sensor], sensors[pair.sweep.sensor]
    if camera.matrix is None:
        raise DatasetError(f"calibrated_sensor.json has no camera_intrinsic of {camera.channel}; get it from nuScenes.")
    theirs = invert(camera.car_from_sensor) @ lidar.car_from_sensor
    return Calibration(camera.matrix, theirs @ invert(OURS_FROM_THEIRS))
