"""What is logged once a frame: the image, the overlays, the error curves and the table."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import rerun as rr

from calibnet.geometry.types import Extrinsic
from inspector import colors, entities
from inspector.record.contents import Contents, Part
from inspector.record.observation import Layout, Observation
from inspector.record.pictures.overlay import Overlay, Thinning, make_overlay
from inspector.record.pictures.painting import make_painter
from inspector.record.tabs.table import stage_table

JPEG_QUALITY = 85
SUCCESS = {"rotation": 1.0, "translation": 2.5}
"""Bounds of the stricter success rate, in the units of `entities.ERROR_KINDS`."""
SPARSE, DENSE = Thinning(cells_across=140, pixel=1.0), Thinning(cells_across=180, pixel=0.25)
"""Sparse keeps about 2,500 of KITTI's 19,000 points: enough to judge, few enough for a megabyte a frame."""


def log_frame(rec: rr.RecordingStream, observation: Observation, contents: Contents) -> None:
    """Log the image, all overlays, the errors, the extrinsics and the table of one frame.

    The timelines ``frame`` and ``time`` must be set; ``step`` is set here: everything belongs to
    the frame's step 0, except `entities.OVERLAY_CURRENT`, which has one row a stage.
    """
    frame = observation.frame
    rec.set_time(entities.STEP, sequence=frame.index * entities.STEPS_PER_FRAME)
    rec.log(entities.IMAGE, rr.Image(frame.image).compress(jpeg_quality=JPEG_QUALITY))
    table = stage_table(observation, Part.OVERLAYS in contents.parts)
    rec.log(entities.TABLE, rr.TextDocument(table, media_type=rr.MediaType.MARKDOWN))
    if Part.CURVES in contents.parts:
        _log_errors(rec, observation)
        _log_fit(rec, observation)
    _log_extrinsics(rec, observation)
    _log_overlays(rec, observation, contents)


def _log_overlays(rec: rr.RecordingStream, observation: Observation, contents: Contents) -> None:
    """The points over the image under every extrinsic; the current one walks through the stages on ``step``."""
    frame, trace = observation.frame, observation.trace
    thinning, paint = DENSE if contents.dense else SPARSE, make_painter(observation, contents.color)

    def overlay(camera_from_lidar: Extrinsic) -> Overlay:
        return make_overlay(observation.projected(camera_from_lidar), frame.camera, thinning, paint)

    def log(path: str, points: Overlay, name: str, camera_from_lidar: Extrinsic) -> None:
        rec.log(path, points.archetype())
        _log_caption(rec, observation, path, name, camera_from_lidar)

    start = "as given" if observation.reference is None else "miscalibrated"
    result = "corrected" if trace.confirmed else "left as it was: picture and scan do not fit"
    initial = overlay(trace.initial)
    log(entities.OVERLAY_MISCALIBRATED, initial, start, trace.initial)
    if observation.reference is not None:
        log(entities.OVERLAY_REFERENCE, overlay(observation.reference), "reference", observation.reference)
    if Part.OVERLAYS not in contents.parts:
        log(entities.OVERLAY_CORRECTED, overlay(trace.corrected), result, trace.corrected)
        return
    log(entities.OVERLAY_CURRENT, initial, start, trace.initial)
    points, first_step = initial, frame.index * entities.STEPS_PER_FRAME
    for stage in trace.stages:
        points, name = overlay(stage.after), f"after stage {stage.number}"
        log(entities.overlay_stage(stage.number), points, name, stage.after)
        rec.set_time(entities.STEP, sequence=first_step + stage.number)
        log(entities.OVERLAY_CURRENT, points, name, stage.after)
        rec.set_time(entities.STEP, sequence=first_step)
    log(entities.OVERLAY_CORRECTED, points if trace.confirmed else initial, result, trace.corrected)


def _log_caption(
    rec: rr.RecordingStream, observation: Observation, overlay: str, name: str, camera_from_lidar: Extrinsic
) -> None:
    """Write into the picture which extrinsic it shows, and how far off that is."""
    error = observation.error(camera_from_lidar)
    off = error is not None and name != "reference"
    figures = f": {error.rotation_deg:.2f}°, {error.translation_cm:.1f} cm off" if off and error else ""
    caption = rr.Points2D(
        [[observation.frame.camera.width / 2, 0.0]],
        labels=f"{name}{figures}",
        colors=colors.REFERENCE,
        radii=0.0,
        show_labels=True,
    )
    rec.log(entities.caption(overlay), caption)


def _log_errors(rec: rr.RecordingStream, observation: Observation) -> None:
    """Rotation in degrees and translation in centimetres, initial and after every stage."""
    trace = observation.trace
    for kind in entities.ERROR_KINDS:
        if observation.reference is not None:
            rec.log(entities.error_limit(kind), rr.Scalars(SUCCESS[kind]))
        paths = {entities.error_initial(kind): trace.initial, entities.error_corrected(kind): trace.corrected}
        paths |= {entities.error_stage(kind, stage.number): stage.after for stage in trace.stages}
        for path, camera_from_lidar in paths.items():
            error = observation.error(camera_from_lidar)
            if error is not None:
                rec.log(path, rr.Scalars(error.rotation_deg if kind == "rotation" else error.translation_cm))


def _log_fit(rec: rr.RecordingStream, observation: Observation) -> None:
    """How far off every stage expects its matches to be, which needs no reference."""
    trace = observation.trace
    for stage in trace.stages:
        error = observation.image_px(stage, stage.match_error_px)
        rec.log(entities.fit_stage(stage.number), rr.Scalars(error))
    if trace.stages and math.isfinite(trace.match_error_limit_px):
        limit = observation.image_px(trace.stages[-1], trace.match_error_limit_px)
        rec.log(entities.FIT_LIMIT, rr.Scalars(limit))


def _log_extrinsics(rec: rr.RecordingStream, observation: Observation) -> None:
    """Every extrinsic as numbers in full precision, and the camera: what a report or an export needs."""
    frame, trace = observation.frame, observation.trace
    extrinsics = {entities.EXTRINSIC_INITIAL: trace.initial, entities.EXTRINSIC_CORRECTED: trace.corrected}
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
    if Part.CURVES not in layout.contents.parts:
        return
    looks = {stage.number: (stage.short.lower(), colors.STAGES[stage.number]) for stage in layout.stages}
    curves = {entities.fit_stage(number): look for number, look in looks.items()}
    limits = {entities.FIT_LIMIT: "believed: below"}
    for kind, unit in entities.ERROR_KINDS.items() if layout.has_reference else ():
        curves[entities.error_initial(kind)] = ("miscalibrated", colors.INITIAL)
        curves |= {entities.error_stage(kind, number): look for number, look in looks.items()}
        limits[entities.error_limit(kind)] = f"success: below {SUCCESS[kind]:g} {unit}"
    for path, name in limits.items():
        rec.log(path, rr.SeriesLines(names=name, colors=colors.LIMIT, widths=1.5), static=True)
    for path, (name, color) in curves.items():
        rec.log(
            path,
            rr.SeriesLines(names=name, colors=color, widths=2.0),
            rr.SeriesPoints(names=name, colors=color, marker_sizes=3.0),
            static=True,
        )
