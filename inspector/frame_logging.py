"""What is logged once a frame: the image, the overlays, the error curves and the table."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from inspector import colors, entities
from inspector.observation import Detail, Layout, Observation
from inspector.overlay import Overlay, Thinning, make_overlay
from inspector.table import stage_table

JPEG_QUALITY = 85
THINNING = {Detail.OVERVIEW: Thinning(cells_across=140, pixel=1.0), Detail.FULL: Thinning(cells_across=260, pixel=0.25)}
"""Overview keeps about 2,500 of KITTI's 19,000 points: enough to judge, few enough for a megabyte a frame."""


def log_frame(rec: rr.RecordingStream, observation: Observation, detail: Detail) -> None:
    """Log the image, all overlays, the errors, the extrinsics and the table of one frame.

    The timelines ``frame`` and ``time`` must be set; ``step`` is set here: everything belongs to
    the frame's step 0, except `entities.OVERLAY_CURRENT`, which has one row a stage.
    """
    frame, trace = observation.frame, observation.trace
    first_step = frame.index * entities.STEPS_PER_FRAME
    rec.set_time(entities.STEP, sequence=first_step)
    rec.log(entities.IMAGE, rr.Image(frame.image).compress(jpeg_quality=JPEG_QUALITY))
    rec.log(entities.TABLE, rr.TextDocument(stage_table(observation), media_type=rr.MediaType.MARKDOWN))
    _log_errors(rec, observation)
    _log_extrinsics(rec, observation)

    def overlay(camera_from_lidar: NDArray[np.float64]) -> Overlay:
        return make_overlay(frame, camera_from_lidar, THINNING[detail])

    miscalibrated = overlay(trace.initial)
    after_stage = {stage.number: overlay(stage.after) for stage in trace.stages}
    corrected = after_stage[trace.stages[-1].number] if trace.stages else miscalibrated
    rec.log(entities.OVERLAY_MISCALIBRATED, miscalibrated.archetype())
    rec.log(entities.OVERLAY_CORRECTED, corrected.archetype())
    if observation.reference is not None:
        rec.log(entities.OVERLAY_REFERENCE, overlay(observation.reference).archetype())
    rec.log(entities.OVERLAY_CURRENT, miscalibrated.archetype())
    _log_caption(rec, observation, "start" if observation.reference is None else "miscalibrated", trace.initial)
    for stage in trace.stages:
        points = after_stage[stage.number]
        rec.log(entities.overlay_stage(stage.number), points.archetype())
        rec.set_time(entities.STEP, sequence=first_step + stage.number)
        rec.log(entities.OVERLAY_CURRENT, points.archetype())
        _log_caption(rec, observation, f"after stage {stage.number}", stage.after)
        rec.set_time(entities.STEP, sequence=first_step)


def _log_caption(
    rec: rr.RecordingStream, observation: Observation, state: str, camera_from_lidar: NDArray[np.float64]
) -> None:
    """Write into the picture which stage `entities.OVERLAY_CURRENT` shows, and how far off it is."""
    error = observation.error(camera_from_lidar)
    figures = "" if error is None else f": {error.rotation_deg:.2f}°, {error.translation_cm:.1f} cm off"
    width = observation.frame.camera.width
    rec.log(
        entities.OVERLAY_CAPTION,
        rr.Points2D(
            [[width / 2, 0.0]], labels=f"{state}{figures}", colors=colors.REFERENCE, radii=0.0, show_labels=True
        ),
    )


def _log_errors(rec: rr.RecordingStream, observation: Observation) -> None:
    """Rotation in degrees and translation in centimetres, initial and after every stage."""
    trace = observation.trace
    for kind in entities.ERROR_KINDS:
        paths = {entities.error_initial(kind): trace.initial, entities.error_corrected(kind): trace.corrected}
        paths |= {entities.error_stage(kind, stage.number): stage.after for stage in trace.stages}
        for path, camera_from_lidar in paths.items():
            error = observation.error(camera_from_lidar)
            if error is not None:
                rec.log(path, rr.Scalars(error.rotation_deg if kind == "rotation" else error.translation_cm))


def _log_extrinsics(rec: rr.RecordingStream, observation: Observation) -> None:
    """Every extrinsic as numbers in full precision, and the camera: what a report or an export needs."""
    frame, trace = observation.frame, observation.trace
    extrinsics = {entities.EXTRINSIC_INITIAL: trace.initial}
    extrinsics |= {entities.extrinsic_stage(stage.number): stage.after for stage in trace.stages}
    if observation.reference is not None:
        extrinsics[entities.EXTRINSIC_REFERENCE] = observation.reference
    for path, camera_from_lidar in extrinsics.items():
        rec.log(path, rr.AnyValues(camera_from_lidar=camera_from_lidar.astype(np.float64).ravel()))
    camera = rr.AnyValues(
        width=frame.camera.width,
        height=frame.camera.height,
        camera_matrix=frame.camera.matrix.astype(np.float64).ravel(),
        source=Path(frame.source).name,  # not its folder, which is this machine's business
    )
    rec.log(entities.CAMERA, camera)


def log_curve_styles(rec: rr.RecordingStream, layout: Layout) -> None:
    """Name and colour the error curves, once for the recording."""
    if not layout.has_reference:
        return
    for kind in entities.ERROR_KINDS:
        curves = {entities.error_initial(kind): ("miscalibrated", colors.INITIAL)}
        for stage in layout.stages:
            name = f"after {stage.title.lower()}"
            curves[entities.error_stage(kind, stage.number)] = (name, colors.STAGES[stage.number])
        for path, (name, color) in curves.items():
            rec.log(
                path,
                rr.SeriesLines(names=name, colors=color, widths=2.0),
                rr.SeriesPoints(names=name, colors=color, marker_sizes=3.0),
                static=True,
            )
