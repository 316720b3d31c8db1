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
from inspector import colors, entities
from inspector.observation import Detail, Observation

POINTS = {Detail.OVERVIEW: 6_000, Detail.FULL: 30_000}
OUTSIDE = (70, 72, 80)
"""Points that the camera does not see."""
POINT_SIZE = 1.8
FRUSTUM_LENGTH_M = 2.5
RANGE_M = 80.0


def log_scene_frame(rec: rr.RecordingStream) -> None:
    """Declare the world's axes and mark the LiDAR, once for the recording."""
    rec.log(entities.WORLD, rr.ViewCoordinates.FLU, static=True)
    rec.log(entities.LIDAR, rr.TransformAxes3D(0.5), rr.Transform3D(), static=True)


def log_scene(rec: rr.RecordingStream, observation: Observation, detail: Detail) -> None:
    """Log both clouds and all frustums of one frame."""
    frame, trace = observation.frame, observation.trace
    limit = POINTS[detail]
    rec.log(entities.CLOUD_INITIAL, _cloud(frame, trace.initial, limit))
    rec.log(entities.CLOUD_CORRECTED, _cloud(frame, trace.corrected, limit))
    _log_camera(rec, entities.CAMERA_INITIAL, trace.initial, frame.camera, colors.INITIAL)
    for stage in trace.stages:
        color = colors.STAGES[stage.number]
        _log_camera(rec, entities.camera_stage(stage.number), stage.after, frame.camera, color)
    if observation.reference is not None:
        _log_camera(rec, entities.CAMERA_REFERENCE, observation.reference, frame.camera, colors.REFERENCE)


def _cloud(frame: Frame, camera_from_lidar: NDArray[np.float64], limit: int) -> rr.Points3D:
    """The scan, subsampled evenly; points that fall into the image have its colour."""
    near = np.flatnonzero(np.square(frame.points[:, :3]).sum(axis=1) < RANGE_M**2)
    kept = near[:: max(1, -(-len(near) // limit))]
    points = frame.points[kept]
    projection = project(points, camera_from_lidar, frame.camera)
    rgb = np.full((len(points), 3), OUTSIDE, dtype=np.uint8)
    u, v = np.rint(projection.pixels).astype(np.intp).T
    height, width = frame.image.shape[:2]
    rgb[projection.index] = frame.image[np.minimum(v, height - 1), np.minimum(u, width - 1)]
    return rr.Points3D(points[:, :3], colors=rgb, radii=rr.Radius.ui_points(POINT_SIZE))


def _log_camera(
    rec: rr.RecordingStream,
    path: str,
    camera_from_lidar: NDArray[np.float64],
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
            line_width=-2.0,
        ),
    )
