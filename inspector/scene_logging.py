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

POINTS = {Detail.OVERVIEW: 5_000, Detail.FULL: 30_000}
SEEN_SHARE = 0.8
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
    points = _subsample(observation, POINTS[detail])
    rec.log(entities.CLOUD_INITIAL, _colored(frame, points, trace.initial))
    rec.log(entities.CLOUD_CORRECTED, _colored(frame, points, trace.corrected))
    _log_camera(rec, entities.CAMERA_INITIAL, trace.initial, frame.camera, colors.INITIAL)
    for stage in trace.stages:
        color = colors.STAGES[stage.number]
        _log_camera(rec, entities.camera_stage(stage.number), stage.after, frame.camera, color)
    if observation.reference is not None:
        _log_camera(rec, entities.CAMERA_REFERENCE, observation.reference, frame.camera, colors.REFERENCE)


def _subsample(observation: Observation, limit: int) -> NDArray[np.float32]:
    """At most ``limit`` points ``[M, 4]``, most of them such as the camera sees before or after."""
    frame = observation.frame
    near = np.square(frame.points[:, :3]).sum(axis=1) < RANGE_M**2
    seen = np.zeros(len(frame.points), dtype=np.bool_)
    for camera_from_lidar in (observation.trace.initial, observation.trace.corrected):
        seen[project(frame.points, camera_from_lidar, frame.camera).index] = True
    parts = [
        _evenly(np.flatnonzero(near & seen), round(SEEN_SHARE * limit)),
        _evenly(np.flatnonzero(near & ~seen), round((1.0 - SEEN_SHARE) * limit)),
    ]
    return frame.points[np.concatenate(parts)]


def _evenly(rows: NDArray[np.intp], limit: int) -> NDArray[np.intp]:
    return rows[:: max(1, -(-len(rows) // limit))]


def _colored(frame: Frame, points: NDArray[np.float32], camera_from_lidar: NDArray[np.float64]) -> rr.Points3D:
    """Points with the colour of the pixel they fall on, grey where they fall on none."""
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
