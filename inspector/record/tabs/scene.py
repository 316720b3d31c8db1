"""Tab *3D*: the scan coloured by the image, and the camera's pose after every stage.

The world is the LiDAR's own frame (x forward, y left, z up). The scan is therefore static and the cameras move; the
extrinsic only changes which pixel colours which point.
"""

from __future__ import annotations

import math

import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint.encodings import ComponentSourceKind, VisualizerComponentMapping

from calibnet.geometry import PinholeCamera, invert
from calibnet.geometry.types import Extrinsic
from inspector import colors
from inspector.record.contents import Contents, Part
from inspector.record.observation import Layout, Observation, Xyz
from inspector.record.pictures.cloud import seen_colors, subsample
from inspector.record.pictures.legends import log_names
from inspector.record.subtree import Subtree
from inspector.record.tabs.views import View, legend, uncapitalized, with_legend

NAME = "3D"

WORLD = "world"
CLOUD = "world/cloud"
"""Positions, logged once per frame, and colours under every extrinsic: components of the archetype `COLORS_THROUGH`."""
COLORS_THROUGH = "colors_through"
LIDAR = "world/lidar"
CAMERA_INITIAL = "world/camera/initial"
CAMERA_REFERENCE = "world/camera/reference"
LEGEND_CAMERAS = "legend/stages"
"""Legend of the frustums."""

SPARSE, DENSE = 5_000, 30_000
"""Largest numbers of points of the cloud, in sparse and in dense recordings."""
POINT_SIZE = 2.2
FRUSTUM_LENGTH_M = 1.2
BACKGROUND = (44, 47, 54)
"""Background, a grey on which dark points stay visible."""


def camera_stage(number: int) -> str:
    """Entity of the camera's frustum in the LiDAR frame after a stage."""
    return f"world/camera/stage_{number}"


def wanted(layout: Layout) -> bool:
    """Whether the scene is recorded."""
    return Part.SCENE in layout.contents.parts


def log_once(rec: Subtree, layout: Layout) -> None:
    """Log the world's axes, the LiDAR and the legend of the cameras."""
    rec.log_once(WORLD, rr.ViewCoordinates.FLU)
    rec.log_once(LIDAR, rr.TransformAxes3D(0.5), rr.Transform3D())
    names = {layout.start.lower(): colors.INITIAL}
    names |= {f"after stage {stage.number}": colors.STAGES[stage.number] for stage in layout.stages}
    log_names(rec, LEGEND_CAMERAS, names | ({"reference": colors.REFERENCE} if layout.has_reference else {}))


def log(rec: Subtree, observation: Observation, contents: Contents) -> None:
    """Log the cloud of a frame, its colours under every extrinsic, and a camera for each."""
    if Part.SCENE not in contents.parts:
        return
    frame, trace = observation.frame, observation.trace
    extrinsics = {"initial": (CAMERA_INITIAL, trace.initial, colors.INITIAL)}
    for stage in trace.stages:
        extrinsics[f"stage_{stage.number}"] = (camera_stage(stage.number), stage.after, colors.STAGES[stage.number])
    if observation.reference is not None:
        extrinsics["reference"] = (CAMERA_REFERENCE, observation.reference, colors.REFERENCE)
    points = subsample(observation, DENSE if contents.dense else SPARSE)
    rec.log(CLOUD, rr.Points3D(points[:, :3], radii=rr.Radius.ui_points(POINT_SIZE)))
    through = {
        name: rr.components.ColorBatch(seen_colors(frame, points, camera_from_lidar))
        for name, (_, camera_from_lidar, _) in extrinsics.items()
    }
    rec.log(CLOUD, rr.DynamicArchetype(archetype=COLORS_THROUGH, components=through))
    for path, camera_from_lidar, color in extrinsics.values():
        rec.log(path, *frustum(camera_from_lidar, frame.camera, color))


def view(layout: Layout) -> View:
    """A page with the cloud coloured under start, result and reference, and a page for every extrinsic."""
    seen = {layout.start: ("initial", CAMERA_INITIAL)}
    seen |= {stage.title: (f"stage_{stage.number}", camera_stage(stage.number)) for stage in layout.stages}
    last, (through, _) = list(seen.items())[-1]
    if layout.has_reference:
        seen["Reference (truth)"] = ("reference", CAMERA_REFERENCE)
    truth = [CAMERA_REFERENCE] if layout.has_reference else []
    cameras = [camera for _, camera in seen.values()]
    compared = {uncapitalized(layout.start): "initial"}
    if layout.stages:
        compared[f"after {uncapitalized(last)}"] = through
    if layout.has_reference:
        compared["reference"] = "reference"
    views = [_scene_view(f"Coloured through: {name}", part, cameras, layout) for name, part in compared.items()]
    pages: dict[str, View] = {"Side by side": rrb.Horizontal(*views)}
    for name, (through, camera) in seen.items():
        shown = list(dict.fromkeys([camera, *truth]))
        pages[name] = _scene_view(f"Coloured through: {uncapitalized(name)}", through, shown, layout)
    legends = (legend("Cameras", LEGEND_CAMERAS) for _ in pages)
    return rrb.Tabs(*map(with_legend, pages.values(), legends, pages), name=NAME)


def frustum(
    camera_from_lidar: Extrinsic, camera: PinholeCamera, color: colors.Rgb
) -> tuple[rr.Transform3D, rr.Pinhole]:
    """The camera's pose in the LiDAR frame, and its field of view."""
    lidar_from_camera = invert(camera_from_lidar)
    return (
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


def _scene_view(name: str, through: str, cameras: list[str], layout: Layout) -> rrb.Spatial3DView:
    """The cloud, seen from above and behind the camera, with the horizon near the upper edge, above which is nothing.

    Args:
        name: name of the view.
        through: component of `COLORS_THROUGH` with the colours of the cloud.
        cameras: entities of the frustums to draw.
        layout: layout with the pose of the camera.
    """
    mapping = VisualizerComponentMapping(
        target="Points3D:colors",
        source_kind=ComponentSourceKind.SourceComponent,
        source_component=f"{COLORS_THROUGH}:{through}",
    )
    return rrb.Spatial3DView(
        origin=f"/{WORLD}",
        contents=[f"/{path}/**" for path in (CLOUD, LIDAR, *cameras)],
        name=name,
        overrides={f"/{CLOUD}": [rr.Points3D.from_fields().visualizer(mappings=[mapping])]},
        eye_controls=rrb.EyeControls3D(
            position=_seen_from(layout, ahead=-4.5, left=1.0, up=4.0),
            look_target=_seen_from(layout, ahead=12.0, left=0.0, up=-2.7),
            eye_up=(0.0, 0.0, 1.0),
        ),
        line_grid=rrb.LineGrid3D(visible=False),
        background=BACKGROUND,
        defaults=[rr.TransformAxes3D(0.0)],
    )


def _seen_from(layout: Layout, ahead: float, left: float, up: float) -> Xyz:
    """A position in the LiDAR frame, given in metres relative to the camera and its heading."""
    (x, y, z), (dx, dy, _) = layout.position, layout.forward
    length = math.hypot(dx, dy) or 1.0
    dx, dy = dx / length, dy / length
    return x + ahead * dx - left * dy, y + ahead * dy + left * dx, z + up
