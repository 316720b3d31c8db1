"""A random, seeded world of roads and halls, ray-cast for a camera and a spinning LiDAR."""

from calibnet.datasets.synthetic.hall import Hall, sample_hall
from calibnet.datasets.synthetic.kitti_export import write_kitti_odometry
from calibnet.datasets.synthetic.render import render_frame, sample_frame, sample_robot_frame
from calibnet.datasets.synthetic.rig import KITTI_LIKE, Lidar, Rig, sample_rig
from calibnet.datasets.synthetic.scene import Scene, sample_scene
from calibnet.datasets.synthetic.sequence import SyntheticSequence
from calibnet.datasets.synthetic.world import World

__all__ = [
    "KITTI_LIKE",
    "Hall",
    "Lidar",
    "Rig",
    "Scene",
    "SyntheticSequence",
    "World",
    "render_frame",
    "sample_frame",
    "sample_hall",
    "sample_robot_frame",
    "sample_rig",
    "sample_scene",
    "write_kitti_odometry",
]
