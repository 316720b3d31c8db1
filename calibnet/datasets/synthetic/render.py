"""Scene + rig + pose to a `Frame`: one ray-cast world, one photograph, one scan."""

from __future__ import annotations

import numpy as np

from calibnet.datasets.frame import Frame
from calibnet.datasets.synthetic.camera import Exposure, photograph, sample_exposure
from calibnet.datasets.synthetic.lidar import scan
from calibnet.datasets.synthetic.rig import Rig, sample_rig
from calibnet.datasets.synthetic.shading import caster
from calibnet.datasets.synthetic.world import Scene, build_scene
from calibnet.geometry import invert
from calibnet.geometry.types import Transform

Generator = np.random.Generator
TRAINING_SECTOR = float(np.radians(65.0))
"""Half the azimuth around the camera's axis that training frames scan."""


def render_frame(
    scene: Scene,
    rig: Rig,
    vehicle_pose: Transform,
    generator: Generator,
    index: int = 0,
    timestamp: float = 0.0,
    sector: float = float(np.pi),
    exposure: Exposure | None = None,
    source: str = "synthetic",
) -> Frame:
    """Photograph and scan a scene from one pose.

    Args:
        scene: the world.
        rig: sensors and mount.
        index: number of the frame.
        exposure: how the camera develops; drawn if not given.
        source: names the frame in messages.
        vehicle_pose: ``world_from_vehicle``, for instance from ``scene.pose(station)``.
        generator: noise, drop-outs and, unless given, the exposure.
        timestamp: seconds; where the moving traffic is.
        sector: half the azimuth, radians, that is scanned around the camera's axis; pi for all.
    """
    world_from_lidar = vehicle_pose @ rig.vehicle_from_lidar
    world_from_camera = world_from_lidar @ invert(rig.camera_from_lidar)
    axis = rig.camera_from_lidar[2, :3]  # the camera's optical axis in the LiDAR frame
    facing = float(np.arctan2(axis[1], axis[0]))
    mesh = scene.mesh(vehicle_pose, timestamp, *_reach(facing, sector))
    rays = caster(mesh)
    points = scan(rays, mesh, rig.lidar, world_from_lidar, facing, sector, generator)
    settings = exposure or sample_exposure(generator)
    image = photograph(rays, mesh, scene.weather, rig.camera, world_from_camera, settings, generator)
    return Frame(index, timestamp, image, points, rig.camera, rig.camera_from_lidar.copy(), source)


def _reach(facing: float, sector: float) -> tuple[float, float]:
    """Metres of road behind and ahead that a camera and a sector of the scan can see, or cast shadows into."""
    if sector > 0.6 * np.pi:
        return 100.0, 120.0
    if abs(np.sin(facing)) > 0.7:
        return 65.0, 65.0
    return (15.0, 120.0) if abs(facing) < 0.5 * np.pi else (120.0, 15.0)


def sample_frame(seed: int) -> Frame:
    """One random scene seen by one random rig, small enough to be drawn during training."""
    generator = np.random.default_rng(seed)
    scene = build_scene(generator)
    rig = sample_rig(generator)
    pose = scene.pose(generator.uniform(50.0, 350.0), yaw=generator.normal(0.0, 0.03))
    return render_frame(scene, rig, pose, generator, sector=TRAINING_SECTOR, source=f"synthetic seed {seed}")
