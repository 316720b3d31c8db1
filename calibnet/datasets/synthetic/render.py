"""Scene + rig + pose to a `Frame`: one ray-cast world, one photograph, one scan."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.random import Generator

from calibnet.datasets.frame import Frame
from calibnet.datasets.synthetic.camera import Exposure, photograph, sample_exposure, sample_indoor_exposure
from calibnet.datasets.synthetic.hall import sample_hall
from calibnet.datasets.synthetic.lidar import scan
from calibnet.datasets.synthetic.mesh import Mesh
from calibnet.datasets.synthetic.rig import Rig, sample_rig, sample_robot_rig
from calibnet.datasets.synthetic.scene import sample_scene
from calibnet.datasets.synthetic.shading import caster
from calibnet.datasets.synthetic.weather import Weather
from calibnet.datasets.synthetic.world import World
from calibnet.geometry import invert
from calibnet.geometry.types import Transform

TRAINING_SECTOR = float(np.radians(65.0))
"""Half the azimuth around the camera's axis that training frames scan."""
INDOORS = 2 / 3
"""Share of the robots' frames that are taken in halls."""


class Surroundings(Protocol):
    """The surroundings that a frame shows: a `World` along a road, or a `Hall`."""

    @property
    def weather(self) -> Weather:
        """Its light."""
        ...

    def mesh(self, world_from_vehicle: Transform, time: float, behind: float = 100.0, ahead: float = 120.0) -> Mesh:
        """Everything around a vehicle, see `World.mesh`."""
        ...


def render_frame(
    world: Surroundings,
    rig: Rig,
    world_from_vehicle: Transform,
    generator: Generator,
    index: int = 0,
    timestamp: float = 0.0,
    sector: float = float(np.pi),
    exposure: Exposure | None = None,
    source: str = "synthetic",
) -> Frame:
    """Render the image and the scan of a world from one pose.

    Args:
        world: the surroundings.
        rig: sensors and mount.
        world_from_vehicle: pose of the vehicle, 4x4, for instance from ``world.scene.pose(station)``.
        generator: draws the noise, the lost returns and, unless given, the exposure.
        index: number of the frame.
        timestamp: time in seconds, which moves the traffic.
        sector: half the azimuth that is scanned around the camera's axis, radians; pi for a full revolution.
        exposure: exposure of the camera; drawn if not given.
        source: name of the frame in messages.
    """
    world_from_lidar = world_from_vehicle @ rig.vehicle_from_lidar
    world_from_camera = world_from_lidar @ invert(rig.camera_from_lidar)
    axis = rig.camera_from_lidar[2, :3]  # the camera's optical axis in the LiDAR frame
    facing = float(np.arctan2(axis[1], axis[0]))
    if abs(axis[2]) > np.hypot(axis[0], axis[1]):  # the scanner's axis points where the camera looks
        sector = float(np.pi)
    mesh = world.mesh(world_from_vehicle, timestamp, *_reach(facing, sector))
    rays = caster(mesh)
    points = scan(rays, mesh, rig.lidar, world_from_lidar, facing, sector, generator)
    settings = exposure or sample_exposure(generator)
    image = photograph(rays, mesh, world.weather, rig.camera, world_from_camera, settings, generator)
    return Frame(index, timestamp, image, points, rig.camera, rig.camera_from_lidar.copy(), source)


def _reach(facing: float, sector: float) -> tuple[float, float]:
    """Metres of road behind and ahead that are visible to the camera and the scan's sector, or cast shadows there."""
    if sector > 0.6 * np.pi:
        return 100.0, 120.0
    if abs(np.sin(facing)) > 0.7:
        return 65.0, 65.0
    return (15.0, 120.0) if abs(facing) < 0.5 * np.pi else (120.0, 15.0)


def sample_frame(seed: int) -> Frame:
    """A random scene seen by a random rig, small enough to be rendered during training."""
    generator = np.random.default_rng(seed)
    scene = sample_scene(generator)
    rig = sample_rig(generator)
    pose = scene.pose(generator.uniform(50.0, 350.0), yaw=generator.normal(0.0, 0.03))
    return render_frame(World(scene), rig, pose, generator, sector=TRAINING_SECTOR, source=f"synthetic seed {seed}")


def sample_robot_frame(seed: int) -> Frame:
    """A random hall, or one time in three a road, seen by a random `sample_robot_rig`; small, for training."""
    generator = np.random.default_rng([seed, 1])
    rig, exposure = sample_robot_rig(generator), sample_indoor_exposure(generator)
    world: Surroundings
    if generator.random() < INDOORS:
        hall = sample_hall(generator)
        world, pose = hall, hall.place
    else:
        scene = sample_scene(generator)
        world, pose = World(scene), scene.pose(generator.uniform(50.0, 350.0), yaw=generator.normal(0.0, 0.2))
    return render_frame(
        world, rig, pose, generator, sector=TRAINING_SECTOR, exposure=exposure, source=f"synthetic robot, seed {seed}"
    )
