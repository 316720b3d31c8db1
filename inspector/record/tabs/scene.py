"""The 3D scene: the scan coloured by the image, and the camera where every stage believes it is.

The world is the LiDAR's own frame (x forward, y left, z up). The scan therefore stands still and
the cameras move; what the extrinsic changes about the scan is which pixel colours which point.
"""

from __future__ import annotations

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from calibnet.datasets.frame import Frame
from calibnet.geometry import PinholeCamera, invert, project
from calibnet.geometry.types import Extrinsic
from inspector import colors, entities
from inspector.record.contents import Contents, Part
from inspector.record.observation import Observation

SPARSE, DENSE = 5_000, 30_000
SEEN_SHARE = 0.8
OUTSIDE = (70, 72, 80)
"""Points that the camera does not see."""
POINT_SIZE = 1.6
FRUSTUM_LENGTH_M = 1.2
RANGE_M = 80.0


def log_scene_frame(rec: rr.RecordingStream) -> None:
    """Declare the world's axes and mark the LiDAR, once for the recording."""
    rec.log(entities.WORLD, rr.ViewCoordinates.FLU, static=True)
    rec.log(entities.LIDAR, rr.TransformAxes3D(0.5), rr.Transform3D(), static=True)


def log_scene(rec: rr.RecordingStream, observation: Observation, contents: Contents) -> None:
    """Log the cloud, its colours through every extrinsic, and all frustums of one frame."""
    if Part.SCENE not in contents.parts:
        return
    frame, trace = observation.frame, observation.trace
    extrinsics = {"initial": (entities.CAMERA_INITIAL, trace.initial, colors.INITIAL)}
    for stage in trace.stages:
        path = entities.camera_stage(stage.number)
        extrinsics[f"stage_{stage.number}"] = (path, stage.after, colors.STAGES[stage.number])
    if observation.reference is not None:
        extrinsics["reference"] = (entities.CAMERA_REFERENCE, observation.reference, colors.REFERENCE)
    points = _subsample(observation, DENSE if contents.dense else SPARSE)
    rec.log(entities.CLOUD, rr.Points3D(points[:, :3], radii=rr.Radius.ui_points(POINT_SIZE)))
    through = {
        name: rr.components.ColorBatch(_seen_colors(frame, points, camera_from_lidar))
        for name, (_, camera_from_lidar, _) in extrinsics.items()
    }
    rec.log(entities.CLOUD, rr.DynamicArchetype(archetype=entities.COLORS_THROUGH, components=through))
    for path, camera_from_lidar, color in extrinsics.values():
        _log_camera(rec, path, camera_from_lidar, frame.camera, color)


def _subsample(observation: Observation, limit: int) -> NDArray[np.float32]:
    """At most ``limit`` points ``[M, 4]``, most of them such as the camera sees before or after."""
    frame = observation.frame
    near = np.square(frame.points[:, :3]).sum(axis=1) < RANGE_M**2
    seen = np.zeros(len(frame.points), dtype=np.bool_)
    for camera_from_lidar in (observation.trace.initial, observation.trace.corrected):
        seen[observation.projected(camera_from_lidar).index] = True
    parts = [
        _evenly(np.flatnonzero(near & seen), round(SEEN_SHARE * limit)),
        _evenly(np.flatnonzero(near & ~seen), round((1.0 - SEEN_SHARE) * limit)),
    ]
    return frame.points[np.concatenate(parts)]


def _evenly(rows: NDArray[np.intp], limit: int) -> NDArray[np.intp]:
    return rows[:: max(1, -(-len(rows) // limit))]


def _seen_colors(frame: Frame, points: NDArray[np.float32], camera_from_lidar: Extrinsic) -> NDArray[np.uint8]:
    """``[M, 3]``: the colour of the pixel that each point falls on, grey where it falls on none."""
    projection = project(points, camera_from_lidar, frame.camera)
    rgb = np.full((len(points), 3), OUTSIDE, dtype=np.uint8)
    u, v = np.rint(projection.pixels).astype(np.intp).T
    height, width = frame.image.shape[:2]
    rgb[projection.index] = frame.image[np.minimum(v, height - 1), np.minimum(u, width - 1)]
    return rgb


def _log_camera(
    rec: rr.RecordingStream,
    path: str,
    camera_from_lidar: Extrinsic,
    camera: PinholeCamera,
    color: colors.Rgb,
) -> None:
    lidar_from_camera = invert(camera_from_lidar)
    rec.log(
        path,
        rr.Transform3D(translation=lidar_from_camera[:3, 3], mat3x3=lidar_from_camera[:3, :3]),
        rr.Pinhole(
            image_from_camera=camera.matrix,
            resolution=[camera.width, camera.height],
            camera_xyz=rr.ViewCoordinates.RDF,
            image_plane_distance=FRUSTUM_LENGTH_M,
            color=color,
            line_width=-1.5,
        ),
    )
