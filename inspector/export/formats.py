"""Formats of a calibration as text for other tools, each of which states its convention."""

from __future__ import annotations

import json

import cv2
import numpy as np
from scipy.spatial.transform import Rotation as ScipyRotation

from calibnet.geometry import CameraModel, invert
from calibnet.geometry.types import Floats, Rotation
from calibnet.runtime.text import one_line
from inspector.export.exported import Exported

AXES = "LiDAR x forward, y left, z up; camera x right, y down, z forward (optical frame); metres"
OF_COVARIANCE = "(translation m, rotation rad) in the camera's frame"
CONVENTION = f"camera_from_lidar maps LiDAR points into the camera, x_camera = R x_lidar + t; {AXES}"


def as_kitti(exported: Exported) -> str:
    """A ``calib.txt`` of KITTI odometry: ``P0`` to ``P3`` and ``Tr``, 3x4 row by row.

    All four cameras are the calibrated one, so that tools that use any of them work. Comments come last and look like
    entries, since readers parse every line.
    """
    projection = np.hstack([exported.camera.matrix, np.zeros((3, 1))])
    lines = [_entry(f"P{camera}", projection) for camera in range(4)]
    lines.append(_entry("Tr", exported.camera_from_lidar[:3]))
    lines.append(f"# convention: Tr = {CONVENTION}")
    lines.append("# cameras: P0 to P3 are the same rectified camera, pixels = P0 Tr x_lidar, without baseline")
    if not exported.camera.is_pinhole:
        named = ", ".join(f"{name} {value!r}" for name, value in lens(exported.camera).items())
        lines.append(f"# lens: this format has no lens; first rectify the images, with the same matrix, from {named}")
    lines += [f"# {line}" for line in covariance_lines(exported)]
    lines.append(f"# source: calib-inspect, {exported.origin}")
    return "\n".join([*lines, ""])


def as_ros(exported: Exported) -> str:
    """A ROS 2 launch file (YAML) of a static transform, with the equivalent command line in a comment."""
    frames, lidar_is_parent = exported.frames, exported.frames.lidar_is_parent
    parent, child = (frames.lidar, frames.camera) if lidar_is_parent else (frames.camera, frames.lidar)
    parent_from_child = invert(exported.camera_from_lidar) if lidar_is_parent else exported.camera_from_lidar
    names = ("x", "y", "z", "qx", "qy", "qz", "qw")
    values = [*parent_from_child[:3, 3], *quaternion_xyzw(parent_from_child[:3, :3])]
    numbers = " ".join(f"--{name} {value:.15f}" for name, value in zip(names, values, strict=True))
    arguments = f"{numbers} --frame-id {parent} --child-frame-id {child}"
    return "\n".join(
        [
            f"# Static transform {parent} -> {child}: the pose of {child} in {parent}, that is {parent}_from_{child};",
            f"# {AXES}; quaternion x y z w.",
            f"# Source: calib-inspect, {exported.origin}",
            *(f"# {line}" for line in covariance_lines(exported)),
            "# On the command line:",
            f"#   ros2 run tf2_ros static_transform_publisher {arguments}",
            "launch:",
            "  - node:",
            "      pkg: tf2_ros",
            "      exec: static_transform_publisher",
            "      name: lidar_camera_calibration",
            f'      args: "{arguments}"',
            "",
        ]
    )


def as_opencv(exported: Exported) -> str:
    """A YAML file for ``cv2.FileStorage``, with ``rvec`` and ``tvec`` as ``cv2.projectPoints`` takes them."""
    storage = cv2.FileStorage(".yaml", cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY)
    storage.writeComment(CONVENTION)
    storage.writeComment("camera_matrix in pixels, their centres at integers; distortion is that of the raw images")
    storage.writeComment(f"Source: calib-inspect, {exported.origin}")
    storage.write("image_width", exported.camera.width)
    storage.write("image_height", exported.camera.height)
    storage.write("camera_matrix", exported.camera.matrix)
    for name, value in lens(exported.camera).items():
        storage.write(name, np.array([value]) if isinstance(value, list) else value)
    storage.write("camera_from_lidar", exported.camera_from_lidar)
    storage.write("rvec", cv2.Rodrigues(exported.camera_from_lidar[:3, :3])[0])
    storage.write("tvec", exported.camera_from_lidar[:3, 3:])
    if exported.covariance is not None:
        storage.writeComment(f"Covariance of {OF_COVARIANCE}")
        storage.write("covariance", exported.covariance)
    return str(storage.releaseAndGetString())


def as_json(exported: Exported) -> str:
    """One JSON object, whose key ``convention`` states what the matrices mean."""
    matrix = exported.camera_from_lidar
    content = {
        "convention": f"{CONVENTION}; quaternion x y z w; pixel centres at integers",
        "source": f"calib-inspect, {exported.origin}",
        "camera_from_lidar": matrix.tolist(),
        "lidar_from_camera": invert(matrix).tolist(),
        "translation_m": matrix[:3, 3].tolist(),
        "quaternion_xyzw": quaternion_xyzw(matrix[:3, :3]).tolist(),
        "image_width": exported.camera.width,
        "image_height": exported.camera.height,
        "camera_matrix": exported.camera.matrix.tolist(),
        **lens(exported.camera),
        "covariance": None if exported.covariance is None else exported.covariance.tolist(),
        "covariance_of": OF_COVARIANCE,
    }
    return f"{json.dumps(content, indent=2)}\n"


def as_calibration(exported: Exported) -> str:
    """The ``calibration.yaml`` of a plain folder, which `calib-inspect folder` reads."""
    camera, matrix = exported.camera, exported.camera_from_lidar
    of_lens = {"distortion_model": camera.model, **camera.named, "distortion": camera.distortion.tolist()}
    content = {"width": camera.width, "height": camera.height, "camera_matrix": camera.matrix.tolist(), **of_lens}
    rows = [f"{name}: {json.dumps(value)}" for name, value in content.items()]
    return "\n".join(
        [
            f"# Source: calib-inspect, {one_line(exported.origin)}",
            f"# {CONVENTION}",
            *(f"# {line}" for line in covariance_lines(exported)),
            *rows,
            "camera_from_lidar:",
            *(f"  - {json.dumps(row)}" for row in matrix.tolist()),
            "",
        ]
    )


def lens(camera: CameraModel) -> dict[str, str | float | list[float]]:
    """The lens as files store it: model, coefficients with names of their own, and the others in OpenCV's order."""
    of_model: dict[str, str | float | list[float]] = {"distortion_model": camera.model, **camera.named}
    return of_model | {"distortion_coefficients": camera.distortion.tolist()}


def covariance_lines(exported: Exported) -> list[str]:
    """What is known of the uncertainty, as lines of a comment: one, or none."""
    if exported.covariance is None:
        return []
    rows = "; ".join(" ".join(f"{value:.9g}" for value in row) for row in exported.covariance.tolist())
    return [f"Covariance of {OF_COVARIANCE}: {rows}"]


def quaternion_xyzw(rotation: Rotation) -> Floats:
    """The unit quaternion of a 3x3 rotation, with ``w`` not negative."""
    quaternion: Floats = ScipyRotation.from_matrix(rotation).as_quat(canonical=True)
    return quaternion


def _entry(name: str, matrix: Floats) -> str:
    return f"{name}: {' '.join(repr(value) for value in matrix.ravel().tolist())}"
