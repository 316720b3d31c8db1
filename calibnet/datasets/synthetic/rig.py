"""Sensors and their mount: LiDAR beam patterns, lenses, and the extrinsic between them."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.random import Generator

from calibnet.geometry import PinholeCamera, rotation_from_euler_xyz, transform
from calibnet.geometry.types import Extrinsic, Floats, Transform, Vector3

CAMERA_AXES = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
"""Rotation from a LiDAR's axes (x forward, y left, z up) to a camera's (x right, y down, z forward)."""
DOME_AXES = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
"""Rotation from a dome LiDAR's axes, whose z points forward and whose x points down, to those of an upright LiDAR."""


@dataclass(frozen=True, eq=False)
class Lidar:
    """A spinning LiDAR.

    Attributes:
        name: the pattern it resembles.
        elevation: ``[B]`` angle of each beam above the horizontal, radians.
        azimuth_shift: ``[B]`` angle by which each beam is turned about the vertical, radians.
        azimuth_step: angle between firings, radians.
        minimum_range, maximum_range: metres; the largest range is that of a bright surface seen head-on.
        range_noise: standard deviation, metres.
        dropout: share of returns lost at random.
        gain, gamma: factor and exponent of the intensity.
        falloff: share of the intensity that is lost at ``maximum_range``; proportionally less at shorter range.
    """

    name: str
    elevation: Floats = field(repr=False)
    azimuth_shift: Floats = field(repr=False)
    azimuth_step: float
    minimum_range: float = 1.5
    maximum_range: float = 100.0
    range_noise: float = 0.02
    dropout: float = 0.02
    gain: float = 1.0
    gamma: float = 1.0
    falloff: float = 0.2


@dataclass(frozen=True, eq=False)
class Rig:
    """A camera and a LiDAR on one vehicle.

    Attributes:
        name: name to show in titles.
        camera: intrinsics of the rectified image.
        camera_from_lidar: the exact extrinsic, 4x4.
        vehicle_from_lidar: pose of the LiDAR in the vehicle's frame (x forward, z up, origin on the ground), 4x4.
        lidar: the scanner.
    """

    name: str
    camera: PinholeCamera
    camera_from_lidar: Extrinsic = field(repr=False)
    vehicle_from_lidar: Transform = field(repr=False)
    lidar: Lidar


def _hdl64() -> Floats:
    return np.concatenate([np.linspace(2.0, -8.33, 32), np.linspace(-8.83, -24.33, 32)])


def _pandar40() -> Floats:
    dense = np.arange(2.0, -6.1, -0.333)
    return np.concatenate([[15.0, 11.0, 8.0, 5.0, 3.0], dense, np.arange(-7.0, -17.0, -1.0)])[:40]


def _dense128() -> Floats:
    share = np.linspace(-1.0, 1.0, 128)
    return np.asarray(-5.0 + 20.0 * (0.45 * share + 0.55 * share**3))


_PATTERNS = {
    "HDL-64": _hdl64,
    "VLP-16": lambda: np.linspace(15.0, -15.0, 16),
    "HDL-32": lambda: np.linspace(10.67, -30.67, 32),
    "OS1-64": lambda: np.linspace(16.6, -16.6, 64),
    "OS1-32": lambda: np.linspace(22.5, -22.5, 32),
    "Pandar40": _pandar40,
    "Pandar64": lambda: np.concatenate(
        [[14.9, 11.0, 8.0, 5.0], np.linspace(3.0, -6.0, 52), np.linspace(-7.0, -24.0, 8)]
    ),
    "OS2-128": lambda: np.linspace(11.2, -11.2, 128),
    "OS0-128": lambda: np.linspace(30.0, -30.0, 128),
    "VLS-128": _dense128,
}


def sample_lidar(generator: Generator) -> Lidar:
    """Draw a scanner: a known pattern two times in three, an invented one otherwise."""
    if generator.random() < 0.67:
        weights = np.array([4.0, 1.0, 3.0, 2.0, 1.0, 1.0, 2.0, 1.0, 0.7, 1.0])
        name = str(generator.choice(list(_PATTERNS), p=weights / weights.sum()))
        degrees = _PATTERNS[name]()
    else:
        beams = int(generator.choice([16, 32, 40, 64, 128], p=[0.12, 0.25, 0.18, 0.33, 0.12]))
        name, top = f"uniform-{beams}", generator.uniform(2.0, 20.0)
        degrees = np.linspace(top, -generator.uniform(10.0, 32.0), beams)
        if generator.random() < 0.5:  # denser towards the horizon
            name, degrees = f"dense-{beams}", np.sign(degrees) * np.abs(degrees) ** 1.5 / np.abs(degrees).max() ** 0.5
    beams = len(degrees)
    jitter = generator.uniform(0.0, 0.05) * generator.normal(size=beams)
    step = generator.uniform(0.16, 0.26) if beams < 100 else generator.uniform(0.25, 0.36)
    return Lidar(
        name=name,
        elevation=np.radians(degrees + jitter),
        azimuth_shift=np.radians(generator.uniform(0.0, 4.0) * generator.uniform(-1.0, 1.0, beams)),
        azimuth_step=float(np.radians(step)),
        minimum_range=float(generator.uniform(0.8, 2.5)),
        maximum_range=float(generator.uniform(60.0, 120.0)),
        range_noise=float(generator.uniform(0.01, 0.03)),
        dropout=float(generator.uniform(0.0, 0.12)),
        gain=float(generator.uniform(0.5, 1.5)),
        gamma=float(generator.uniform(0.6, 1.5)),
        falloff=float(generator.uniform(0.0, 0.6)),
    )


def camera_pose(forward_yaw: float, pitch: float, roll: float, position: Vector3) -> Extrinsic:
    """``camera_from_lidar`` of a camera at ``position`` (LiDAR frame) that is turned left by ``forward_yaw``.

    Angles in radians; positive pitch looks down, positive roll tilts the camera clockwise.
    """
    cos, sin = np.cos(forward_yaw), np.sin(forward_yaw)
    level_from_lidar = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
    rotation = rotation_from_euler_xyz([pitch, 0.0, roll]) @ CAMERA_AXES @ level_from_lidar
    return transform(rotation, -rotation @ position)


def sample_camera(generator: Generator, pixels: int, maximum_width: int) -> PinholeCamera:
    """Draw an image shape and a lens, at most ``maximum_width`` wide and with about ``pixels`` pixels."""
    aspect = float(
        generator.choice([3.31, 3.31, 3.31, 2.6, 2.6, 2.0, 2.0, 1.78, 1.78, 1.6, 1.333]) * generator.uniform(0.95, 1.05)
    )
    width = int(min(maximum_width, np.sqrt(pixels * aspect)))
    height = round(width / aspect)
    limit = 110.0 if aspect > 1.6 else 95.0
    field_of_view = np.radians(generator.triangular(40.0, 75.0, limit))
    focal = 0.5 * width / np.tan(0.5 * field_of_view)
    center = np.array([0.5 * width - 0.5, 0.5 * height - 0.5]) + generator.normal(0.0, 0.02, 2) * width
    matrix = np.array([[focal, 0.0, center[0]], [0.0, focal * generator.uniform(0.985, 1.015), center[1]], [0, 0, 1.0]])
    return PinholeCamera(width, height, matrix)


def sample_rig(generator: Generator, pixels: int = 128_000, maximum_width: int = 660) -> Rig:
    """Draw a whole rig: scanner, lens, image shape and mount."""
    side = generator.random()
    if side < 0.72:
        yaw = generator.normal(0.0, np.radians(3.0))
    elif side < 0.82:
        yaw = np.pi + generator.normal(0.0, np.radians(4.0))
    else:
        yaw = generator.choice([-1.0, 1.0]) * np.radians(generator.choice([30.0, 55.0, 55.0, 80.0, 110.0]))
        yaw += generator.normal(0.0, np.radians(5.0))
    lidar_height = generator.uniform(1.4, 2.2)
    spread = np.array([0.4, 0.35, 0.3])
    position = np.clip(generator.normal([0.1 * np.cos(yaw), 0.0, -0.2], spread), -1.2, 1.2)
    if generator.random() < 0.15:
        position[:2] = generator.uniform(-1.2, 1.2, 2)
    position[2] = max(position[2], 0.9 - lidar_height)
    camera = sample_camera(generator, pixels, maximum_width)
    vertical = 2.0 * np.arctan(0.5 * camera.height / camera.focal[1])
    pitch = generator.normal(0.02 if vertical < 0.6 else 0.05, np.radians(2.0))
    tilt = generator.normal(0.0, np.radians(0.7), 2)
    lidar = sample_lidar(generator)
    return Rig(
        name=f"synthetic {lidar.name}, {camera.width}x{camera.height}",
        camera=camera,
        camera_from_lidar=camera_pose(yaw, pitch, generator.normal(0.0, np.radians(1.2)), position),
        vehicle_from_lidar=transform(rotation_from_euler_xyz([tilt[0], tilt[1], 0.0]), [0.0, 0.0, lidar_height]),
        lidar=lidar,
    )


KITTI_LIKE = Rig(
    name="synthetic KITTI-like, 1242x375",
    camera=PinholeCamera(1242, 375, np.array([[720.0, 0.0, 612.0], [0.0, 720.0, 174.0], [0.0, 0.0, 1.0]])),
    camera_from_lidar=camera_pose(0.012, 0.008, -0.004, np.array([0.28, 0.01, -0.08])),
    vehicle_from_lidar=transform(np.eye(3), [0.0, 0.0, 1.73]),
    lidar=Lidar(
        name="HDL-64",
        elevation=np.radians(_hdl64()),
        azimuth_shift=np.radians(np.where(np.arange(64) % 2 == 0, 0.04, -0.04)),
        azimuth_step=float(np.radians(0.18)),
        minimum_range=2.0,
        maximum_range=90.0,
    ),
)
"""A rig like the one of KITTI's cars: a wide colour image and a 64-beam scanner on the roof."""


def sample_robot_rig(generator: Generator, pixels: int = 128_000, maximum_width: int = 520) -> Rig:
    """Draw a robot's or a slow car's rig: a scanner that looks up as far as down, a squarer and often wider image.

    One scanner of five is a dome whose rings run around the view, see `DOME_AXES`.
    """
    beams = int(generator.choice([16, 32, 64, 128], p=[0.25, 0.3, 0.3, 0.15]))
    up, dome = float(generator.choice([15.0, 22.5, 45.0, 52.0])), bool(generator.random() < 0.2)
    degrees = np.linspace(88.0, 25.0, beams) if dome else np.linspace(up, -generator.uniform(0.5, 1.0) * up, beams)
    lidar = replace(
        sample_lidar(generator),
        name=f"{'dome' if dome else 'indoor'}-{beams}",
        elevation=np.radians(degrees),
        azimuth_shift=np.zeros(beams),
        azimuth_step=float(np.radians(generator.uniform(0.25, 0.5))),
        minimum_range=float(generator.uniform(0.3, 1.0)),
    )
    aspect = float(generator.choice([1.0, 1.333, 1.333, 1.6, 1.78]))
    width = int(min(maximum_width, np.sqrt(pixels * aspect)))
    height = round(width / aspect)
    focal = 0.5 * width / np.tan(0.5 * np.radians(generator.triangular(50.0, 85.0, 122.0)))
    center = np.array([0.5 * width - 0.5, 0.5 * height - 0.5]) + generator.normal(0.0, 0.02, 2) * width
    matrix = np.array([[focal, 0.0, center[0]], [0.0, focal, center[1]], [0.0, 0.0, 1.0]])
    position = np.clip(generator.normal([0.05, 0.0, -0.1], [0.15, 0.2, 0.12]), -0.6, 0.6)
    yaw, pitch, roll = (float(angle) for angle in generator.normal(0.0, np.radians([4.0, 4.0, 1.5])))
    tilt = generator.normal(0.0, np.radians(1.0), 2)
    turned = transform(DOME_AXES if dome else np.eye(3), [0.0, 0.0, 0.0])
    mount = transform(rotation_from_euler_xyz([tilt[0], tilt[1], 0.0]), [0.0, 0.0, generator.uniform(0.7, 1.8)])
    return Rig(
        name=f"synthetic {lidar.name}, {width}x{height}",
        camera=PinholeCamera(width, height, matrix),
        camera_from_lidar=camera_pose(yaw, pitch, roll, position) @ turned,
        vehicle_from_lidar=mount @ turned,
        lidar=lidar,
    )
