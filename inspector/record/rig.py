"""Records a rig: all its cameras side by side, the cloud coloured by all of them, and the residuals of each.

The entities of each camera are those of an ordinary recording, below a prefix of its own.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from calibnet.datasets.frame import Frame, Frames
from calibnet.datasets.selection import evenly_spaced
from calibnet.errors import DatasetError
from calibnet.trace import CascadeTrace
from inspector import colors, entities
from inspector.record.contents import Coloring, Contents, Detail
from inspector.record.frame import JPEG_QUALITY
from inspector.record.observation import Observation
from inspector.record.pictures.captions import caption_strip
from inspector.record.pictures.cloud import OUTSIDE, RANGE_M, seen_colors
from inspector.record.pictures.frame_overlays import FrameOverlays
from inspector.record.pictures.legends import log_point_legend
from inspector.record.recording import RunDescription
from inspector.record.stream import Stream, plain
from inspector.record.subtree import Subtree
from inspector.record.tabs.blueprint import move_below
from inspector.record.tabs.scene import BACKGROUND, POINT_SIZE, frustum
from inspector.record.tabs.views import (
    LEGEND_SHARE,
    SCREEN_HEIGHT,
    SCREEN_WIDTH,
    TITLE_HEIGHT,
    View,
    in_rows,
    legend,
    overlay_view,
    with_legend,
)
from inspector.rig_result import CameraResult, RigResult

MOMENTS = 40
"""Largest number of frames shown of each camera, spread over the drive."""
POINTS = 40_000
"""Largest number of points of the cloud."""
CLOUD, WORLD, TEXT = "rig/cloud", "rig", "rig/result"
FEW_CAMERAS = 2
"""Largest number of cameras whose images are large side by side."""
LEFT_SHARE = 0.64
"""Share of the tab's width that the images take."""
TEXT_SHARE = 0.58
"""Share of the height beside them that the text takes, with a row for each of six cameras."""


@dataclass(frozen=True)
class Shown:
    """A camera of the rig, with its name in views and its frames."""

    solved: CameraResult
    name: str
    frames: Frames

    @property
    def prefix(self) -> str:
        """Prefix of the camera's entities."""
        return entities.camera_of_rig(self.solved.name)


def record_rig(
    sinks: Sequence[Any],
    description: RunDescription,
    solved: RigResult,
    frames: Mapping[str, Frames],
    observer: Callable[[int, int], None] = lambda done, total: None,
) -> int:
    """Write the recording of a rig.

    Args:
        sinks: Rerun's sinks, see `inspector.record.outputs`.
        description: identifies the run.
        solved: the result.
        frames: frames of each camera by its name; a frame that cannot be read is left out.
        observer: called with the number of moments recorded so far, and the total.

    Returns:
        The number of moments shown.
    """
    named = zip(solved.cameras, solved.short_names, strict=True)
    cameras = [Shown(camera, name, frames[camera.name]) for camera, name in named]
    stream = Stream(entities.APPLICATION_ID, description.recording_id, description.title, sinks, rig_blueprint(cameras))
    try:
        rec = Subtree(stream.rec)
        stream.rec.send_property(entities.RUN, rr.AnyValues(**plain(description.options)))
        stream.rec.send_property(entities.PROVENANCE, rr.AnyValues(**description.provenance))
        rec.log_once(entities.RIG, rr.AnyValues(rig_json=json.dumps(solved.recorded())))
        rec.log_once(TEXT, rr.TextDocument("\n".join(solved.markdown()), media_type=rr.MediaType.MARKDOWN))
        rec.log_once(WORLD, rr.ViewCoordinates.FLU)
        log_point_legend(rec, Coloring.DEPTH)
        moments = evenly_spaced(max(len(camera.frames) for camera in cameras), MOMENTS)
        for done, position in enumerate(moments):
            observer(done, len(moments))
            _log_moment(stream.rec, cameras, position)
            stream.flush()
        observer(len(moments), len(moments))
    finally:
        stream.close()
    return len(moments)


def _log_moment(rec: rr.RecordingStream, cameras: Sequence[Shown], position: int) -> None:
    """Log the images of all cameras at one position of their frames, and the scan that they see."""
    seen = list[tuple[Shown, Frame]]()
    for camera in cameras:
        try:
            frame = camera.frames[position] if position < len(camera.frames) else None
        except DatasetError:
            continue
        if frame is not None:
            seen.append((camera, frame))
    if not seen:
        return
    for camera, frame in seen:
        below = Subtree(rec, camera.prefix)
        below.set_frame(position, seen[0][1].timestamp)
        _log_camera(below, camera.solved, frame)
    _log_cloud(Subtree(rec), seen)


def _log_camera(rec: Subtree, solved: CameraResult, frame: Frame) -> None:
    """Log the image with the points under the initial extrinsic, the result and the reference."""
    verdict, start = solved.verdict, solved.initial
    rec.log(entities.IMAGE, rr.Image(frame.as_taken.image).compress(jpeg_quality=JPEG_QUALITY))
    observation = Observation(frame, CascadeTrace(start, ()), solved.reference)
    overlays = FrameOverlays(observation, Contents.of(Detail.OVERVIEW))
    overlays.log(rec, entities.OVERLAY_MISCALIBRATED, observation.start, start)
    word, found = verdict.word, verdict.camera_from_lidar
    overlays.log(rec, entities.OVERLAY_CORRECTED, word, found, colors.VERDICTS[word])
    if solved.reference is not None:
        overlays.log_reference(rec, entities.OVERLAY_REFERENCE, solved.reference)


def _log_cloud(rec: Subtree, seen: Sequence[tuple[Shown, Frame]]) -> None:
    """Log the scan in the colours of all cameras, and the poses of the cameras."""
    points = whole_scan([frame for _, frame in seen])
    rgb = np.full((len(points), 3), OUTSIDE, np.uint8)
    for camera, frame in seen:
        found = seen_colors(frame, points, camera.solved.verdict.camera_from_lidar)
        new = (found != OUTSIDE).any(axis=1) & (rgb == OUTSIDE).all(axis=1)
        rgb[new] = found[new]
        color = colors.VERDICTS[camera.solved.verdict.word]
        rec.log(f"{WORLD}/{camera.prefix}", *frustum(camera.solved.verdict.camera_from_lidar, frame.camera, color))
    rec.log(CLOUD, rr.Points3D(points[:, :3], colors=rgb, radii=rr.Radius.ui_points(POINT_SIZE)))


def whole_scan(frames: Sequence[Frame]) -> NDArray[np.float32]:
    """The points ``[N, 4]`` of a moment without far ones: the scan that all cameras share, or the union of their scans.

    Files of one camera may hold only what that camera sees.
    """
    points = np.concatenate([frame.points for frame in frames])
    points = np.unique(points[np.linalg.norm(points[:, :3], axis=1) < RANGE_M], axis=0)
    return np.ascontiguousarray(points[:: max(1, -(-len(points) // POINTS))])


def rig_blueprint(cameras: Sequence[Shown]) -> rrb.Blueprint:
    """The layout: a tab with everything, and one for each camera."""
    sizes = [camera.solved.camera for camera in cameras]
    pictures = [
        _below(
            camera,
            overlay_view(
                camera.name,
                entities.OVERLAY_CORRECTED,
                (size.width, size.height),
                small=len(cameras) > FEW_CAMERAS,
            ),
        )
        for camera, size in zip(cameras, sizes, strict=True)
    ]
    grid = in_rows(pictures, _columns(len(pictures), (sizes[0].width, sizes[0].height)))
    left = with_legend(grid, legend("Depth of the points", entities.LEGEND_POINTS), "Cameras")
    cloud = rrb.Spatial3DView(
        origin=f"/{WORLD}",
        name="The cloud, coloured by all cameras",
        background=BACKGROUND,
        line_grid=rrb.LineGrid3D(visible=False),
        eye_controls=rrb.EyeControls3D(
            position=(-12.0, 0.0, 9.0), look_target=(5.0, 0.0, -1.0), eye_up=(0.0, 0.0, 1.0)
        ),
    )
    text = rrb.TextDocumentView(origin=TEXT, name="Result and residuals")
    together = rrb.Horizontal(
        left,
        rrb.Vertical(text, cloud, row_shares=[TEXT_SHARE, 1 - TEXT_SHARE]),
        column_shares=[LEFT_SHARE, 1 - LEFT_SHARE],
        name="Rig",
    )
    return rrb.Blueprint(
        rrb.Tabs(together, *(_page(camera) for camera in cameras), active_tab=0),
        rrb.TimePanel(timeline=entities.FRAME, state="collapsed"),
        collapse_panels=True,
        auto_views=False,
        auto_layout=False,
    )


def _page(camera: Shown) -> View:
    """The page of one camera: its result, and below it the initial extrinsic and the reference."""
    size = camera.solved.camera.width, camera.solved.camera.height
    names = {"As given": entities.OVERLAY_MISCALIBRATED}
    if camera.solved.reference is not None:
        names = {"Miscalibrated": entities.OVERLAY_MISCALIBRATED, "Reference (truth)": entities.OVERLAY_REFERENCE}
    below = [_below(camera, overlay_view(name, path, size, small=True)) for name, path in names.items()]
    found = _below(camera, overlay_view("Found", entities.OVERLAY_CORRECTED, size))
    side_by_side = size[0] < 2 * size[1]  # tall images leave room beside them
    layout = rrb.Horizontal if side_by_side else rrb.Vertical
    small = rrb.Vertical(*below) if side_by_side else rrb.Horizontal(*below)
    return layout(found, small, name=camera.name)


def _below(camera: Shown, view: rrb.View) -> rrb.View:
    move_below(view, camera.prefix)
    return view


def _columns(cameras: int, image: tuple[int, int]) -> int:
    """Number of columns of the grid in which images of this size, with their captions and titles, are largest."""
    width, height = image[0], image[1] + caption_strip(image).height
    room = SCREEN_HEIGHT * (1 - LEGEND_SHARE)

    def scale(columns: int) -> float:
        rows = math.ceil(cameras / columns)
        return min(LEFT_SHARE * SCREEN_WIDTH / columns / width, (room / rows - TITLE_HEIGHT) / height)

    return max(range(1, cameras + 1), key=scale)
