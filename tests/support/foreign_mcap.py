"""MCAP files that no ROS 2 recorded: ROS messages in another profile, and Foxglove's schemas in JSON and protobuf."""

from __future__ import annotations

import base64
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from google.protobuf import descriptor_pb2
from google.protobuf.descriptor_pool import DescriptorPool
from google.protobuf.json_format import ParseDict
from google.protobuf.message_factory import GetMessageClass
from mcap.writer import Writer
from scipy.spatial.transform import Rotation

from calibnet.datasets.frame import Frame
from tests.support.bags import CAMERA_FRAME, LIDAR_FRAME, BagWriter

START = 1_700_000_000
_TIME = {"timestamp": "Timestamp", "frame_id": "string"}
SCHEMAS: dict[str, dict[str, str]] = {
    "Timestamp": {"seconds": "int64", "nanos": "int32"},
    "Vector3": dict.fromkeys("xyz", "double"),
    "Quaternion": dict.fromkeys("xyzw", "double"),
    "Pose": {"position": "Vector3", "orientation": "Quaternion"},
    "PackedElementField": {"name": "string", "offset": "uint32", "type": "int32"},
    "CompressedImage": {**_TIME, "data": "bytes", "format": "string"},
    "RawImage": {
        **_TIME,
        **dict.fromkeys(("width", "height", "step"), "uint32"),
        "encoding": "string",
        "data": "bytes",
    },
    "PointCloud": {
        **_TIME,
        "pose": "Pose",
        "point_stride": "uint32",
        "fields": "*PackedElementField",
        "data": "bytes",
    },
    "CameraCalibration": {
        **_TIME,
        **dict.fromkeys(("width", "height"), "uint32"),
        "distortion_model": "string",
        **dict.fromkeys("DKRP", "*double"),
    },
    "FrameTransform": {
        "timestamp": "Timestamp",
        **dict.fromkeys(("parent_frame_id", "child_frame_id"), "string"),
        "translation": "Vector3",
        "rotation": "Quaternion",
    },
    "FrameTransforms": {"transforms": "*FrameTransform"},
}
"""The fields of Foxglove's schemas that are written here; a star for several."""


class ForeignMcap:
    """Writes a file; ``encoding`` is ``ros1``, ``cdr``, ``json`` or ``protobuf``."""

    def __init__(self, path: Path, encoding: str, summary: bool = True) -> None:
        self.path, self.encoding = path, encoding
        self._file = path.open("wb")
        self._writer = Writer(self._file, use_statistics=summary, use_summary_offsets=summary, repeat_channels=summary)
        self._writer.start(profile="ros1" if encoding == "ros1" else "", library="tests")
        self._channels: dict[str, int] = {}
        self._descriptors = _descriptors()
        pool = DescriptorPool()
        pool.Add(self._descriptors.file[0])
        self._pool = pool

    def write(self, topic: str, name: str, content: dict[str, Any] | bytes, at: float, definition: str = "") -> None:
        """A message: bytes of ROS, or the fields of one of Foxglove's schemas."""
        if isinstance(content, bytes):
            schema, data = (name, f"{self.encoding.replace('cdr', 'ros2')}msg", definition.encode()), content
        elif self.encoding == "json":
            schema, data = (f"foxglove.{name}", "jsonschema", b"{}"), json.dumps(_as_json(content)).encode()
        else:
            message = GetMessageClass(self._pool.FindMessageTypeByName(f"foxglove.{name}"))()
            ParseDict(content, message)
            described = self._descriptors.SerializeToString()
            schema, data = (f"foxglove.{name}", "protobuf", described), message.SerializeToString()
        if topic not in self._channels:
            number = self._writer.register_schema(*schema)
            self._channels[topic] = self._writer.register_channel(topic, self.encoding, number)
        self._writer.add_message(self._channels[topic], round(at * 1e9), data, round(at * 1e9))

    def close(self) -> Path:
        self._writer.finish()
        self._file.close()
        return self.path


def _as_json(content: dict[str, Any]) -> dict[str, Any]:
    """JSON calls the parts of a time otherwise than protobuf does."""

    def renamed(value: Any) -> Any:
        if isinstance(value, list):
            return [renamed(one) for one in value]
        if not isinstance(value, dict):
            return value
        if value.keys() == {"seconds", "nanos"}:
            return {"sec": value["seconds"], "nsec": value["nanos"]}
        return {key: renamed(one) for key, one in value.items()}

    renamed_whole: dict[str, Any] = renamed(content)
    return renamed_whole


def _descriptors() -> descriptor_pb2.FileDescriptorSet:
    whole = descriptor_pb2.FileDescriptorSet()
    file = whole.file.add(name="foxglove.proto", package="foxglove", syntax="proto3")
    kinds = descriptor_pb2.FieldDescriptorProto
    for name, fields in SCHEMAS.items():
        message = file.message_type.add(name=name)
        for number, (field, kind) in enumerate(fields.items(), start=1):
            label = kinds.LABEL_REPEATED if kind.startswith("*") else kinds.LABEL_OPTIONAL
            kind = kind.lstrip("*")
            added = message.field.add(name=field, number=number, label=label)
            if kind in SCHEMAS:
                added.type, added.type_name = kinds.TYPE_MESSAGE, f".foxglove.{kind}"
            else:
                added.type = getattr(kinds, f"TYPE_{kind.upper()}")
    return whole


def time_of(at: float) -> dict[str, int]:
    return {"seconds": int(at), "nanos": round(at % 1 * 1e9)}


def image_of(frame: Frame, at: float) -> dict[str, Any]:
    png = cv2.imencode(".png", frame.image[..., ::-1])[1].tobytes()
    data = base64.b64encode(png).decode()
    return {"timestamp": time_of(at), "frame_id": CAMERA_FRAME, "data": data, "format": "png"}


def cloud_of(frame: Frame, at: float, **more: Any) -> dict[str, Any]:
    fields = [{"name": name, "offset": 4 * i, "type": 7} for i, name in enumerate(("x", "y", "z", "intensity"))]
    data = base64.b64encode(frame.points.astype("<f4").tobytes()).decode()
    head = {"timestamp": time_of(at), "frame_id": LIDAR_FRAME}
    return {**head, "point_stride": 16, "fields": fields, "data": data, **more}


def quaternion_of(pose: np.ndarray) -> list[float]:
    """x y z w."""
    found: list[float] = Rotation.from_matrix(pose[:3, :3]).as_quat().tolist()
    return found


def transform_of(frame: Frame, at: float) -> dict[str, Any]:
    pose = frame.camera_from_lidar
    turn = dict(zip("xyzw", quaternion_of(pose), strict=True))
    moved = dict(zip("xyz", pose[:3, 3].tolist(), strict=True))
    names = {"parent_frame_id": CAMERA_FRAME, "child_frame_id": LIDAR_FRAME}
    return {"timestamp": time_of(at), **names, "translation": moved, "rotation": turn}


def write_foxglove(
    path: Path, encoding: str, frames: Sequence[Frame], bag: ForeignMcap | None = None, **cloud: Any
) -> Path:
    """Frames a second apart, with what Foxglove's own schemas say; a robot that moves is among the transforms."""
    bag = bag or ForeignMcap(path, encoding)
    camera = frames[0].camera
    matrix = {"K": camera.matrix.ravel().tolist(), "D": [0.0] * 5, "R": [], "P": []}
    size = {"width": camera.width, "height": camera.height, "distortion_model": "plumb_bob"}
    for number, frame in enumerate(frames):
        at = float(START + number)
        head = {"timestamp": time_of(at), "frame_id": CAMERA_FRAME}
        robot = {**transform_of(frame, at), "parent_frame_id": "map", "child_frame_id": "base"}
        robot["translation"] = {"x": float(number), "y": 0.0, "z": 0.0}
        bag.write("/tf", "FrameTransforms", {"transforms": [robot, transform_of(frames[0], at)]}, at)
        bag.write("/cam/calibration", "CameraCalibration", {**head, **size, **matrix}, at)
        bag.write("/cam/image", "CompressedImage", image_of(frame, at), at)
        bag.write("/lidar", "PointCloud", cloud_of(frame, at + 0.01, **cloud), at + 0.01)
    return bag.close()


class Rewritten(BagWriter):
    """ROS messages in a file of another profile."""

    def __init__(self, path: Path, encoding: str) -> None:
        super().__init__(path.with_suffix(".bag") if encoding == "ros1" else path.with_suffix(""), encoding)
        self.foreign = ForeignMcap(path, encoding)

    def write(self, topic: str, message: Any, seconds: float) -> None:
        name = message.__msgtype__
        serialize = self.types.serialize_ros1 if self.ros1 else self.types.serialize_cdr
        definition, _ = self.types.generate_msgdef(name, ros_version=1 if self.ros1 else 2)
        shown = name.replace("/msg/", "/") if self.ros1 else name
        self.foreign.write(topic, shown, bytes(serialize(message, name)), seconds, definition)

    def close(self) -> Path:
        self.writer.close()
        return self.foreign.close()
