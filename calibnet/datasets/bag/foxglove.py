"""Converts messages of Foxglove's schemas, in protobuf or JSON, to those of ROS that `messages` reads.

The schemas are described at docs.foxglove.dev/docs/sdk/schemas. JSON may hold anything in the place of a number, so
each is held against its type here.
"""

from __future__ import annotations

import base64
from collections.abc import Callable
from operator import index
from types import SimpleNamespace
from typing import Any

from calibnet.datasets.calibration_files.ros import REGION
from calibnet.errors import DatasetError

POINT_TYPES = {1: 2, 2: 1, 3: 4, 4: 3, 5: 6, 6: 5, 7: 7, 8: 8}
"""Types of point fields and their numbers in PointCloud2, which has signed before unsigned types."""


def seconds_of(time: Any) -> float:
    """A time, of protobuf (seconds, nanos) or of JSON (sec, nsec), in seconds."""
    if hasattr(time, "nanos"):
        return float(time.seconds + 1e-9 * time.nanos)
    return float(time.sec + 1e-9 * time.nsec)


def _header(message: Any) -> SimpleNamespace:
    return SimpleNamespace(frame_id=message.frame_id, seconds=seconds_of(message.timestamp))


def _bytes(data: bytes | str) -> bytes:
    return base64.b64decode(data) if isinstance(data, str) else bytes(data)


def _compressed(message: Any) -> SimpleNamespace:
    return SimpleNamespace(header=_header(message), data=_bytes(message.data), format=getattr(message, "format", ""))


def _raw(message: Any) -> SimpleNamespace:
    return SimpleNamespace(
        header=_header(message),
        width=index(message.width),
        height=index(message.height),
        encoding=message.encoding,
        step=index(message.step),
        data=memoryview(_bytes(message.data)),
        is_bigendian=False,
    )


def _points(message: Any) -> SimpleNamespace:
    pose = getattr(message, "pose", None)
    if pose is not None and not _is_identity(pose):
        raise DatasetError("its points have a pose within their frame, which is not supported")
    data, stride = memoryview(_bytes(message.data)), index(message.point_stride)
    count = len(data) // max(1, stride)
    fields = [
        SimpleNamespace(
            name=field.name, offset=index(field.offset), datatype=POINT_TYPES.get(int(field.type), 0), count=1
        )
        for field in message.fields
    ]
    return SimpleNamespace(
        header=_header(message),
        width=count,
        height=1,
        point_step=stride,
        row_step=count * stride,
        fields=fields,
        data=data,
        is_bigendian=False,
    )


def _is_identity(pose: Any) -> bool:
    place, turn = getattr(pose, "position", None), getattr(pose, "orientation", None)
    here = place is None or max(abs(place.x), abs(place.y), abs(place.z)) < 1e-9
    return here and (turn is None or max(abs(turn.x), abs(turn.y), abs(turn.z)) < 1e-9)


def _camera(message: Any) -> SimpleNamespace:
    return SimpleNamespace(
        header=_header(message),
        width=index(message.width),
        height=index(message.height),
        distortion_model=message.distortion_model or ("" if any(message.D) else "plumb_bob"),
        d=[float(value) for value in message.D],
        k=[float(value) for value in message.K],
        r=[float(value) for value in message.R],
        p=[float(value) for value in message.P],
        binning_x=0,
        binning_y=0,
        roi=SimpleNamespace(**dict.fromkeys(REGION, 0)),
    )


def _transform(message: Any) -> SimpleNamespace:
    return SimpleNamespace(
        header=SimpleNamespace(frame_id=message.parent_frame_id, seconds=seconds_of(message.timestamp)),
        child_frame_id=message.child_frame_id,
        transform=SimpleNamespace(
            translation=_floats(message.translation, "xyz"), rotation=_floats(message.rotation, "xyzw")
        ),
    )


def _floats(said: Any, names: str) -> SimpleNamespace:
    return SimpleNamespace(**{name: float(getattr(said, name)) for name in names})


def _of_several(transforms: list[SimpleNamespace]) -> SimpleNamespace:
    seconds = transforms[0].header.seconds if transforms else 0.0
    return SimpleNamespace(header=SimpleNamespace(frame_id="", seconds=seconds), transforms=transforms)


AS_ROS: dict[str, tuple[str, Callable[[Any], SimpleNamespace]]] = {
    "foxglove.CompressedImage": ("sensor_msgs/msg/CompressedImage", _compressed),
    "foxglove.RawImage": ("sensor_msgs/msg/Image", _raw),
    "foxglove.PointCloud": ("sensor_msgs/msg/PointCloud2", _points),
    "foxglove.CameraCalibration": ("sensor_msgs/msg/CameraInfo", _camera),
    "foxglove.FrameTransform": ("tf2_msgs/msg/TFMessage", lambda one: _of_several([_transform(one)])),
    "foxglove.FrameTransforms": (
        "tf2_msgs/msg/TFMessage",
        lambda several: _of_several([_transform(one) for one in several.transforms]),
    ),
}
"""The equivalent ROS type of each schema, and the conversion."""
