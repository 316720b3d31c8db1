"""Reads ROS messages as images, points, cameras and transforms."""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from calibnet.datasets.calibration_files.frames import Link
from calibnet.datasets.calibration_files.ros import REGION
from calibnet.datasets.clouds.columns import MOST_POINTS, CloudError, Columns
from calibnet.datasets.images.development import BAYER, ImageError, Levels
from calibnet.datasets.images.files import decode_levels
from calibnet.geometry import transform
from calibnet.geometry.types import Rotation

IMAGES = ("sensor_msgs/msg/CompressedImage", "sensor_msgs/msg/Image")
LIVOX = tuple(f"{package}/msg/CustomMsg" for package in ("livox_ros_driver", "livox_ros_driver2", "livox_interfaces"))
"""Names of the scans of Livox's drivers, which are all of the same form."""
POINTS = ("sensor_msgs/msg/PointCloud2", *LIVOX)
PACKETS = re.compile(r"packet|(velodyne|hesai|pandar|rslidar|robosense|seyond)\w*scan", re.IGNORECASE)
"""Pattern in the names of messages with the raw data of a scanner."""
INFOS = ("sensor_msgs/msg/CameraInfo",)
TRANSFORMS = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")

CHANNELS: dict[str, tuple[type[np.generic], int, int | None]] = {
    "rgb8": (np.uint8, 3, None),
    "bgr8": (np.uint8, 3, cv2.COLOR_BGR2RGB),
    "8UC3": (np.uint8, 3, cv2.COLOR_BGR2RGB),
    "rgba8": (np.uint8, 4, cv2.COLOR_RGBA2RGB),
    "bgra8": (np.uint8, 4, cv2.COLOR_BGRA2RGB),
    "mono8": (np.uint8, 1, cv2.COLOR_GRAY2RGB),
    "8UC1": (np.uint8, 1, cv2.COLOR_GRAY2RGB),
    "mono16": (np.uint16, 1, cv2.COLOR_GRAY2RGB),
    "16UC1": (np.uint16, 1, cv2.COLOR_GRAY2RGB),
    "rgb16": (np.uint16, 3, None),
    "bgr16": (np.uint16, 3, cv2.COLOR_BGR2RGB),
    # OpenCV names Bayer patterns by their second row and column, ROS by their first
    "bayer_rggb8": (np.uint8, 1, cv2.COLOR_BayerBG2RGB),
    "bayer_bggr8": (np.uint8, 1, cv2.COLOR_BayerRG2RGB),
    "bayer_gbrg8": (np.uint8, 1, cv2.COLOR_BayerGR2RGB),
    "bayer_grbg8": (np.uint8, 1, cv2.COLOR_BayerGB2RGB),
    "bayer_rggb16": (np.uint16, 1, cv2.COLOR_BayerBG2RGB),
    "bayer_bggr16": (np.uint16, 1, cv2.COLOR_BayerRG2RGB),
    "bayer_gbrg16": (np.uint16, 1, cv2.COLOR_BayerGR2RGB),
    "bayer_grbg16": (np.uint16, 1, cv2.COLOR_BayerGB2RGB),
    "yuv422": (np.uint8, 2, cv2.COLOR_YUV2RGB_UYVY),
    "uyvy": (np.uint8, 2, cv2.COLOR_YUV2RGB_UYVY),
    "yuv422_yuy2": (np.uint8, 2, cv2.COLOR_YUV2RGB_YUY2),
    "yuyv": (np.uint8, 2, cv2.COLOR_YUV2RGB_YUY2),
}
"""Encodings of raw images: type and number of a pixel's values, and OpenCV's conversion to RGB."""
MOSAIC = re.compile(r"bayer_(rggb|bggr|gbrg|grbg)(?:8|16); *\w+ compressed *")
"""Format of a compressed image that still has a Bayer pattern; that of others ends with the encoding packed."""
DEPTH = "compressedDepth"
"""Format of compressed depth images, and the last part of their topics' names; their type is that of images."""
VIDEO = re.compile(r"h\.?26[45]|hevc|av1|vp[89]", re.IGNORECASE)
"""Format of what was compressed as a video, whose images depend on earlier ones."""
POINT_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
"""NumPy types of the fields of a PointCloud2."""


def stamp_of(data: bytes, is_ros2: bool) -> float:
    """Time stamp in the header of an image or scan in seconds, without reading the rest; 0 if it has none."""
    at = 4  # after the CDR header, or the sequence number of ROS 1
    if len(data) < at + 8:
        return 0.0
    little = not is_ros2 or data[1] & 1
    seconds, nanoseconds = struct.unpack_from("<II" if little else ">II", data, at)
    return float(seconds + 1e-9 * nanoseconds)


def levels_of(message: Any) -> Levels:
    """``[H, W, 3]`` RGB of an image, compressed or raw, at its own bit depth.

    Raises:
        ImageError: it is damaged, or its encoding is not supported.
    """
    if not hasattr(message, "encoding"):
        return _decompressed(bytes(message.data), str(message.format))
    encoding = str(message.encoding)
    known = CHANNELS.get(encoding) or CHANNELS.get(encoding.lower())
    if known is None:
        raise ImageError(f"has the unsupported encoding {encoding!r}; record it compressed, or as rgb8")
    kind, channels, code = known
    dtype = np.dtype(kind).newbyteorder(">" if message.is_bigendian else "<")
    row = int(message.width) * channels * dtype.itemsize
    if message.step < row or len(message.data) < message.step * message.height or not row:
        raise ImageError("has fewer bytes than its size requires; record it again")
    rows = np.asarray(message.data, np.uint8)[: message.step * message.height].reshape(message.height, message.step)
    pixels = np.ascontiguousarray(rows[:, :row]).view(dtype).reshape(message.height, message.width, channels)
    pixels = pixels.astype(dtype.newbyteorder("="), copy=False)
    rgb = pixels if code is None else cv2.cvtColor(pixels if channels > 1 else pixels[..., 0], code)
    return np.ascontiguousarray(rgb)


def _decompressed(data: bytes, form: str) -> Levels:
    if DEPTH in form:
        raise ImageError("has depths, not colours or grey levels; give the topic of the camera's images")
    if (video := VIDEO.search(form)) is not None:
        raise ImageError(f"is part of a video ({video[0]}), which is not supported; record it as JPEG, PNG or rgb8")
    levels = decode_levels(data)
    mosaic = MOSAIC.fullmatch(form)
    if mosaic is None or not (levels == levels[..., :1]).all():
        return levels
    return np.asarray(cv2.cvtColor(np.ascontiguousarray(levels[..., 0]), BAYER[mosaic[1]]))


def columns_of(message: Any) -> Columns:
    """Columns ``[N]`` of a PointCloud2 of any layout, or of Livox's message, by name in lower case.

    Raises:
        CloudError: it has fewer bytes than its header states.
    """
    if not hasattr(message, "fields"):
        names = ("x", "y", "z", "reflectivity")
        points = np.array([[getattr(one, name) for name in names] for one in message.points], np.float32)
        return dict(zip(names, points.reshape(-1, len(names)).T, strict=True))
    order = ">" if message.is_bigendian else "<"
    count, step, width = int(message.width) * int(message.height), int(message.point_step), int(message.width)
    if count > MOST_POINTS or not 0 < step <= 4096:
        raise CloudError(f"it promises {count:,} points of {step} bytes")
    data = np.asarray(message.data, np.uint8)
    if message.height > 1 and message.row_step > width * step:  # rows with padding
        if len(data) < message.row_step * message.height:
            raise CloudError(f"it is truncated, it promises {count:,} points")
        data = data[: message.row_step * message.height].reshape(message.height, message.row_step)
        data = np.ascontiguousarray(data[:, : width * step]).reshape(-1)
    if len(data) < count * step:
        raise CloudError(f"it is truncated, it promises {count:,} points")
    fields: dict[str, tuple[str, int]] = {}
    for field in message.fields:
        kind = POINT_TYPES.get(int(field.datatype))
        if kind is not None and int(field.count) <= 1 and int(field.offset) + np.dtype(kind).itemsize <= step:
            fields.setdefault(str(field.name).lower(), (order + kind, int(field.offset)))
    rows = data[: count * step].reshape(count, step)
    return {
        name: np.ascontiguousarray(rows[:, offset : offset + np.dtype(kind).itemsize]).view(kind)[:, 0]
        for name, (kind, offset) in fields.items()
    }


def camera_info_of(message: Any) -> dict[str, Any]:
    """A CameraInfo as a mapping for `calibnet.datasets.calibration_files.ros`."""
    roi = message.roi
    lower = hasattr(message, "k")
    return {
        "width": int(message.width),
        "height": int(message.height),
        "distortion_model": str(message.distortion_model),
        "D": np.asarray(message.d if lower else message.D, np.float64).tolist(),
        "K": np.asarray(message.k if lower else message.K, np.float64).tolist(),
        "R": np.asarray(message.r if lower else message.R, np.float64).tolist(),
        "P": np.asarray(message.p if lower else message.P, np.float64).tolist(),
        "binning_x": int(message.binning_x),
        "binning_y": int(message.binning_y),
        "roi": {key: int(getattr(roi, key)) for key in REGION},
    }


def links_of(message: Any) -> Iterator[Link]:
    """The transforms of a message of ``/tf_static``."""
    for one in message.transforms:
        moved, turned = one.transform.translation, one.transform.rotation
        rotation = _rotation(np.array([turned.x, turned.y, turned.z, turned.w], np.float64))
        parent, child = str(one.header.frame_id).lstrip("/"), str(one.child_frame_id).lstrip("/")
        yield Link(parent, child, transform(rotation, [moved.x, moved.y, moved.z]))


def _rotation(xyzw: NDArray[np.float64]) -> Rotation:
    """The rotation of a quaternion; NaN if it is not valid, so that no frame can use it."""
    from scipy.spatial.transform import Rotation as ScipyRotation

    length = float(np.linalg.norm(xyzw))
    if not 1e-6 < length < np.inf:
        return np.full((3, 3), np.nan)
    return np.asarray(ScipyRotation.from_quat(xyzw).as_matrix(), np.float64)
