"""Formats of a calibration in robotics: URDF, Autoware's sensor calibration, koide3's calib.json."""

from __future__ import annotations

import json

import numpy as np
from scipy.spatial.transform import Rotation as ScipyRotation

from calibnet.datasets.calibration_files.frames import OPTICAL_FROM_BODY
from calibnet.errors import ConfigError
from calibnet.geometry import invert
from calibnet.geometry.types import Transform
from calibnet.runtime.text import one_line
from inspector.export.exported import Exported
from inspector.export.formats import AXES, OF_COVARIANCE, covariance_lines, quaternion_xyzw

KOIDE_MODELS = {"plumb_bob": "plumb_bob", "equidistant": "fisheye", "omnidirectional": "omnidir"}
"""Lens models that koide3's tool supports, and their names there."""


def as_urdf(exported: Exported) -> str:
    """A fixed joint of a URDF, whose ``origin`` is the pose of the child in the parent."""
    frames = exported.frames
    parent, child = (frames.lidar, frames.camera) if frames.lidar_is_parent else (frames.camera, frames.lidar)
    pose = invert(exported.camera_from_lidar) if frames.lidar_is_parent else exported.camera_from_lidar
    xyz, rpy = (" ".join(map(repr, values)) for values in _pose(pose))
    said = [
        f"Source: calib-inspect, {one_line(exported.origin)}",
        f"{AXES}; rpy in radians about fixed x, y, z; origin is the pose of {child} in {parent}",
        *covariance_lines(exported),
    ]
    return "\n".join(
        [
            *(f"<!-- {line.replace('--', '- -')} -->" for line in said),  # two hyphens would end the comment
            f'<joint name="{parent}_to_{child}" type="fixed">'.replace("/", "_"),
            f'  <parent link="{parent}"/>',
            f'  <child link="{child}"/>',
            f'  <origin xyz="{xyz}" rpy="{rpy}"/>',
            "</joint>",
            "",
        ]
    )


def as_autoware(exported: Exported) -> str:
    """Autoware's ``sensor_kit_calibration.yaml`` with the LiDAR as the kit's base.

    Its ``camera_link`` is oriented like a body, x forward; Autoware itself adds the rotation to the optical frame.
    """
    name = exported.frames.camera
    for suffix in ("_optical_frame", "_optical_link", "_optical"):
        name = name.removesuffix(suffix)
    link = f"{name}_link" if name.endswith("camera") else f"{name}/camera_link"
    xyz, rpy = _pose(invert(exported.camera_from_lidar) @ OPTICAL_FROM_BODY)
    values = zip(("x", "y", "z", "roll", "pitch", "yaw"), (*xyz, *rpy), strict=True)
    said = [
        f"Source: calib-inspect, {one_line(exported.origin)}",
        "Metres and radians, roll, pitch, yaw about fixed x, y, z: the pose of the camera's link (x forward, y left, z "
        "up) in the LiDAR's frame",
        *covariance_lines(exported),
    ]
    return "\n".join(
        [
            *(f"# {line}" for line in said),
            f"{exported.frames.lidar}:",
            f"  {link}:",
            *(f"    {axis}: {value!r}" for axis, value in values),
            "",
        ]
    )


def as_koide3(exported: Exported) -> str:
    """``calib.json`` of direct_visual_lidar_calibration; its ``T_lidar_camera`` is the camera in the LiDAR's frame.

    Raises:
        ConfigError: that tool does not support the lens.
    """
    camera, pose = exported.camera, invert(exported.camera_from_lidar)
    model = KOIDE_MODELS.get(camera.model)
    if model is None:
        raise ConfigError(
            f"koide3's calib.json does not support the lens {camera.model}; export as json, opencv or yaml."
        )
    (fx, _, cx), (_, fy, cy), _ = camera.matrix.tolist()
    content = {
        "camera": {
            "camera_model": model,
            "intrinsics": [fx, fy, cx, cy, *camera.named.values()],
            "distortion_coeffs": camera.distortion.tolist(),
        },
        "meta": {
            "source": f"calib-inspect, {exported.origin}",
            "convention": f"T_lidar_camera: x y z, quaternion x y z w, of the camera in the LiDAR's frame; {AXES}",
            "covariance": None if exported.covariance is None else exported.covariance.tolist(),
            "covariance_of": OF_COVARIANCE,
        },
        "results": {"T_lidar_camera": [*pose[:3, 3].tolist(), *quaternion_xyzw(pose[:3, :3]).tolist()]},
    }  # fmt: skip
    return f"{json.dumps(content, indent=2)}\n"


def _pose(parent_from_child: Transform) -> tuple[list[float], list[float]]:
    """x, y, z in metres, and roll, pitch, yaw in radians about the fixed axes x, y, z."""
    angles = ScipyRotation.from_matrix(parent_from_child[:3, :3]).as_euler("xyz")
    return parent_from_child[:3, 3].tolist(), np.asarray(angles, np.float64).tolist()
