"""Small trees in the published layouts of KITTI-360 and nuScenes, written by hand."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from tests.calibnet.datasets.conftest import (
    AXES,
    RECTIFYING,
    VELODYNE_OFFSET,
    VELODYNE_ROTATION,
    K,
    Layout,
    numbers,
    opener,
    small_turn,
    write_frames,
)

FISHEYE_POSE = np.array([[0.0, 0.0, -1.0, 0.7], [1.0, 0.0, 0.0, 1.0], [0.0, -1.0, 0.0, 1.3], [0.0, 0.0, 0.0, 1.0]])
"""Of a camera that looks to one side, on KITTI-360's car."""
MEI = """%YAML:1.0
---
model_type: MEI
camera_name: image_02
image_width: 80
image_height: 60
mirror_parameters:
   xi: 2.2
distortion_parameters:
   k1: 0.016
   k2: 1.65
   p1: 0.0004
   p2: 0.0002
projection_parameters:
   gamma1: 76.
   gamma2: 75.
   u0: 39.5
   v0: 29.5
"""


def rigid(rotation: np.ndarray, translation: Any) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, translation
    return matrix


def write_kitti_360(root: Path) -> Layout:
    """Camera 1, whose place before rectification differs from camera 0's."""
    drive, calibration = "2013_05_28_drive_0003_sync", root / "calibration"
    pose_from_camera0 = rigid(small_turn(0.4, 1), [1.5, 0.4, 1.1])
    pose_from_camera1 = rigid(small_turn(0.38, 1), [1.6, 1.0, 1.1])
    camera0_from_lidar = rigid(VELODYNE_ROTATION, VELODYNE_OFFSET)
    expected = rigid(RECTIFYING, [0, 0, 0]) @ np.linalg.inv(pose_from_camera1) @ pose_from_camera0 @ camera0_from_lidar
    layout = Layout(opener("kitti-360", root, drive=3, camera=1), root, [3, 6, 9], K, expected)
    velodyne = root / "data_3d_raw" / drive / "velodyne_points"
    images = root / "data_2d_raw" / drive / "image_01" / "data_rect"
    write_frames(layout, images, velodyne / "data", ["0000000003", "0000000006", "0000000009"])
    (velodyne / "timestamps.txt").write_text("".join(f"2013-05-28 08:46:0{n}.250000000\n" for n in range(3)))
    calibration.mkdir()
    (calibration / "calib_cam_to_velo.txt").write_text(numbers(np.linalg.inv(camera0_from_lidar)[:3]) + "\n")
    poses = {"image_00": pose_from_camera0, "image_01": pose_from_camera1, "image_02": FISHEYE_POSE}
    rows = "".join(f"{name}: {numbers(pose[:3])}\n" for name, pose in poses.items())
    (calibration / "calib_cam_to_pose.txt").write_text(rows)
    other, of_one = (np.column_stack([K, column]) for column in ([0, 0, 0], [-30.0, 0, 0]))
    layout.calibration = calibration / "perspective.txt"
    layout.calibration.write_text(
        f"calib_time: 01-Jan-2013 10:00:00\nS_rect_01: 64 48\nR_rect_00: {numbers(np.eye(3))}\n"
        f"P_rect_00: {numbers(other)}\nR_rect_01: {numbers(RECTIFYING)}\nP_rect_01: {numbers(of_one)}\n"
    )
    (calibration / "image_02.yaml").write_text(MEI)
    return layout


CAR_FROM_CAMERA = rigid(AXES.T @ small_turn(0.03, 0), [1.7, 0.1, 1.5])
CAR_FROM_LIDAR = rigid(small_turn(-np.pi / 2, 2) @ small_turn(0.01, 1), [0.9, 0.0, 1.8])
"""nuScenes's LiDAR looks along its y axis."""
THEIRS_FROM_OURS = rigid(np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), [0, 0, 0])


def of_pose(pose: np.ndarray) -> dict[str, Any]:
    """As nuScenes writes one: the quaternion is w x y z."""
    wxyz = np.roll(Rotation.from_matrix(pose[:3, :3]).as_quat(), 1)
    return {"translation": pose[:3, 3].tolist(), "rotation": wxyz.tolist()}


def in_their_axes(points: np.ndarray) -> np.ndarray:
    """Five columns, x to the right and y ahead."""
    return np.column_stack([-points[:, 1], points[:, 0], points[:, 2:], np.zeros(len(points))]).astype(np.float32)


def write_nuscenes(root: Path, world_from_later: np.ndarray | None = None) -> Layout:
    """Two scenes, of which the second is opened; its car stands, unless it is somewhere else when images are taken."""
    expected = np.linalg.inv(CAR_FROM_CAMERA) @ CAR_FROM_LIDAR @ THEIRS_FROM_OURS
    layout = Layout(opener("nuscenes", root, scene="scene-0103"), root, [0, 1, 2], K, expected)
    stems = [f"n015__{name}__{n}" for n, name in enumerate("abc")]
    write_frames(layout, root / "samples" / "CAM_FRONT", root / "samples" / "LIDAR_TOP", stems)
    layout.stored = in_their_axes
    for scan, points in zip(layout.scans, layout.points, strict=True):
        scan.unlink()
        in_their_axes(points).tofile(scan.with_suffix(".pcd.bin"))
    layout.scans = [scan.with_suffix(".pcd.bin") for scan in layout.scans]
    world_from_car = rigid(small_turn(0.7, 2), [400.0, 1100.0, 0.0])
    later = world_from_car if world_from_later is None else world_from_later
    data = []
    for n, (image, scan) in enumerate(zip(layout.images, layout.scans, strict=True)):
        for file, sensor, offset in ((scan, "lidar", 0), (image, "front", 40_000)):
            data.append(
                {
                    "token": f"{sensor}{n}",
                    "sample_token": f"s{n}",
                    "ego_pose_token": f"{sensor}{n}",
                    "calibrated_sensor_token": sensor,
                    "timestamp": 1_532_402_927_612_460 + 500_000 * n + offset,
                    "is_key_frame": True,
                    "height": 48 if sensor == "front" else 0,
                    "width": 64 if sensor == "front" else 0,
                    "filename": str(file.relative_to(root)),
                }
            )
    between = {**data[0], "token": "between", "is_key_frame": False, "filename": "sweeps/LIDAR_TOP/none.pcd.bin"}
    elsewhere = [{**one, "token": f"{one['token']}t", "sample_token": "t0"} for one in data[:2]]
    mounts = {
        "front": {"sensor_token": "a", "camera_intrinsic": K.tolist(), **of_pose(CAR_FROM_CAMERA)},
        "lidar": {"sensor_token": "b", "camera_intrinsic": [], **of_pose(CAR_FROM_LIDAR)},
    }
    poses = {one["token"]: later if one["calibrated_sensor_token"] == "front" else world_from_car for one in data}
    tables = {
        "scene": [{"token": "one", "name": "scene-0061"}, {"token": "two", "name": "scene-0103"}],
        "sample": [{"token": f"s{n}", "scene_token": "two"} for n in range(3)]
        + [{"token": "t0", "scene_token": "one"}],
        "sensor": [{"token": "a", "channel": "CAM_FRONT"}, {"token": "b", "channel": "LIDAR_TOP"}],
        "calibrated_sensor": [{"token": token, **mount} for token, mount in mounts.items()],
        "ego_pose": [{"token": token, **of_pose(pose)} for token, pose in poses.items()],
        "sample_data": [*data, between, *elsewhere],
    }
    (root / "v1.0-mini").mkdir()
    for name, records in tables.items():
        (root / "v1.0-mini" / f"{name}.json").write_text(json.dumps(records, indent=0))
    layout.calibration = root / "v1.0-mini" / "calibrated_sensor.json"
    return layout
