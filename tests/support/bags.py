"""Bags of a few frames, written by rosbags: ROS 1, ROS 2 in sqlite3 and in MCAP."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.testing import assert_allclose, assert_array_equal
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from scipy.spatial.transform import Rotation

from calibnet.datasets.frame import Frame
from calibnet.geometry import invert

CAMERA_FRAME, LIDAR_FRAME = "cam_optical", "velodyne"
LIVOX_POINT = "uint32 offset_time\nfloat32 x\nfloat32 y\nfloat32 z\nuint8 reflectivity\nuint8 tag\nuint8 line\n"
LIVOX_SCAN = (
    "std_msgs/Header header\nuint64 timebase\nuint32 point_num\nuint8 lidar_id\nuint8[3] rsvd\nCustomPoint[] points\n"
)


class BagWriter:
    """Writes messages of some topics; ``kind`` is ``ros1``, ``sqlite3`` or ``mcap``."""

    def __init__(self, path: Path, kind: str) -> None:
        self.ros1, self.path = kind == "ros1", path
        self.types = get_typestore(Stores.ROS1_NOETIC if self.ros1 else Stores.ROS2_HUMBLE)
        if self.ros1:
            transforms = "geometry_msgs/TransformStamped[] transforms"
            self.types.register(get_types_from_msg(transforms, "tf2_msgs/msg/TFMessage"))
            self.writer: Any = Writer1(path)
        else:
            plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
            self.writer = Writer2(path, version=9, storage_plugin=plugin)
        self.writer.open()
        self._connections: dict[str, Any] = {}

    def make(self, kind: str, /, **values: Any) -> Any:
        return self.types.types[kind](**values)

    def header(self, seconds: float, frame: str) -> Any:
        stamp = self.make("builtin_interfaces/msg/Time", sec=int(seconds), nanosec=round(seconds % 1 * 1e9))
        sequence = {"seq": 0} if self.ros1 else {}
        return self.make("std_msgs/msg/Header", stamp=stamp, frame_id=frame, **sequence)

    def write(self, topic: str, message: Any, seconds: float) -> None:
        name = message.__msgtype__
        if topic not in self._connections:
            self._connections[topic] = self.writer.add_connection(topic, name, typestore=self.types)
        serialize = self.types.serialize_ros1 if self.ros1 else self.types.serialize_cdr
        self.writer.write(self._connections[topic], round(seconds * 1e9), serialize(message, name))

    def compressed(self, image: np.ndarray, seconds: float) -> Any:
        data = cv2.imencode(".png", image[..., ::-1])[1].reshape(-1)
        header = self.header(seconds, CAMERA_FRAME)
        return self.make("sensor_msgs/msg/CompressedImage", header=header, format="png", data=data)

    def raw(self, image: np.ndarray, encoding: str, seconds: float, bigendian: bool = False) -> Any:
        height, width = image.shape[:2]
        data = np.ascontiguousarray(image).view(np.uint8).reshape(-1)
        return self.make(
            "sensor_msgs/msg/Image",
            header=self.header(seconds, CAMERA_FRAME),
            height=height,
            width=width,
            encoding=encoding,
            is_bigendian=int(bigendian),
            step=len(data) // height,
            data=data,
        )

    def cloud(self, points: np.ndarray, seconds: float) -> Any:
        """As drivers write it: padding after z, a ring and a time behind the intensity."""
        layout = np.dtype(
            {
                "names": ["x", "y", "z", "intensity", "ring", "time"],
                "formats": ["<f4", "<f4", "<f4", "<f4", "<u2", "<f4"],
                "offsets": [0, 4, 8, 16, 20, 24],
                "itemsize": 32,
            }
        )
        table = np.zeros(len(points), layout)
        for column, name in enumerate(("x", "y", "z", "intensity")):
            table[name] = points[:, column]
        types = {"<f4": 7, "<u2": 4}
        fields = [
            self.make(
                "sensor_msgs/msg/PointField",
                name=name,
                offset=layout.fields[name][1],
                datatype=types[kind.str],
                count=1,
            )
            for name, (kind, _) in layout.fields.items()
        ]
        return self.make(
            "sensor_msgs/msg/PointCloud2",
            header=self.header(seconds, LIDAR_FRAME),
            height=1,
            width=len(points),
            fields=fields,
            is_bigendian=False,
            point_step=32,
            row_step=32 * len(points),
            data=table.view(np.uint8).reshape(-1),
            is_dense=True,
        )

    def livox(self, points: np.ndarray, seconds: float, package: str) -> Any:
        """As Livox's drivers write it, with the definitions that they bring."""
        scan, point = f"{package}/msg/CustomMsg", f"{package}/msg/CustomPoint"
        self.types.register(get_types_from_msg(LIVOX_POINT, point) | get_types_from_msg(LIVOX_SCAN, scan))
        rows = [
            self.make(
                point,
                offset_time=number,
                **dict(zip("xyz", map(float, row[:3]), strict=True)),
                reflectivity=int(row[3] * 255),
                tag=0,
                line=0,
            )
            for number, row in enumerate(points)
        ]
        return self.make(
            scan,
            header=self.header(seconds, LIDAR_FRAME),
            timebase=0,
            point_num=len(rows),
            lidar_id=0,
            rsvd=np.zeros(3, np.uint8),
            points=rows,
        )

    def write_all_but_points(self, frame: Frame, seconds: float) -> None:
        """Calibration and image of a frame."""
        self.write("/tf_static", self.transforms(frame.camera_from_lidar), seconds)
        self.write("/cam/camera_info", self.info(frame, "plumb_bob", [0.0] * 5), seconds)
        self.write("/cam/image_raw/compressed", self.compressed(frame.image, seconds), seconds)

    def info(self, frame: Frame, model: str, distortion: Sequence[float]) -> Any:
        matrix = frame.camera.matrix.ravel()
        roi = self.make("sensor_msgs/msg/RegionOfInterest", x_offset=0, y_offset=0, height=0, width=0, do_rectify=False)
        values = {"d": np.array(distortion), "k": matrix, "r": np.eye(3).ravel(), "p": np.zeros(12)}
        if self.ros1:
            values = {name.upper(): value for name, value in values.items()}
        return self.make(
            "sensor_msgs/msg/CameraInfo",
            header=self.header(0.0, CAMERA_FRAME),
            height=frame.camera.height,
            width=frame.camera.width,
            distortion_model=model,
            binning_x=0,
            binning_y=0,
            roi=roi,
            **values,
        )

    def transforms(self, camera_from_lidar: np.ndarray) -> Any:
        """The camera in the LiDAR's frame."""
        lidar_from_camera = invert(camera_from_lidar)
        x, y, z, w = Rotation.from_matrix(lidar_from_camera[:3, :3]).as_quat()
        moved = dict(zip("xyz", lidar_from_camera[:3, 3], strict=True))
        one = self.make(
            "geometry_msgs/msg/TransformStamped",
            header=self.header(0.0, LIDAR_FRAME),
            child_frame_id=CAMERA_FRAME,
            transform=self.make(
                "geometry_msgs/msg/Transform",
                translation=self.make("geometry_msgs/msg/Vector3", **moved),
                rotation=self.make("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w),
            ),
        )
        return self.make("tf2_msgs/msg/TFMessage", transforms=[one])

    def close(self) -> Path:
        self.writer.close()
        return self.path


def write_bag(path: Path, kind: str, frames: Sequence[Frame], period: float = 1.0, late: float = 0.01) -> Path:
    """A bag of frames, a ``period`` apart; each scan is ``late`` seconds after its image, and is there twice."""
    return write_frames(BagWriter(path, kind), frames, period, late)


def write_frames(bag: BagWriter, frames: Sequence[Frame], period: float = 1.0, late: float = 0.01) -> Path:
    """The same with a writer."""
    start = 1_700_000_000.0
    bag.write("/tf_static", bag.transforms(frames[0].camera_from_lidar), start)
    bag.write("/cam/camera_info", bag.info(frames[0], "plumb_bob", [0.0] * 5), start)
    for number, frame in enumerate(frames):
        now = start + 1 + number * period
        bag.write("/cam/image_raw/compressed", bag.compressed(frame.image, now), now)
        bag.write("/points", bag.cloud(frame.points, now + late), now + late)
        bag.write("/points", bag.cloud(frame.points, now + late + 0.1), now + late + 0.1)
    return bag.close()


def assert_holds(bag: Sequence[Frame], frames: Sequence[Frame]) -> None:
    """A bag has these frames, a second apart."""
    assert len(bag) == len(frames)
    for frame, expected in zip(bag, frames, strict=True):
        assert_array_equal(frame.image, expected.image)
        assert_allclose(frame.points, expected.points, atol=1e-6)
        assert_allclose(frame.camera.matrix, expected.camera.matrix)
        assert_allclose(frame.camera_from_lidar, expected.camera_from_lidar, atol=1e-9)
    assert_allclose([frame.timestamp for frame in bag], range(len(frames)), atol=1e-6)
