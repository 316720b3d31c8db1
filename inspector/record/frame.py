"""Logs what every recording has of a frame, whatever its tabs: image, table, verdict, extrinsics and camera."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import rerun as rr

from calibnet.datasets.frame import Frame
from calibnet.runtime.text import one_line
from calibnet.verdict import Verdict
from inspector import entities
from inspector.record.contents import Contents, Part
from inspector.record.observation import Observation
from inspector.record.pictures.underlay import log_underlays
from inspector.record.subtree import Subtree
from inspector.record.tabs.table import stage_table

JPEG_QUALITY = 85


def log_frame(rec: Subtree, observation: Observation, contents: Contents) -> None:
    """Set the timelines to a frame, and log what every recording has of it."""
    frame = observation.frame
    rec.set_frame(frame.index, frame.timestamp)
    log_image(rec, frame)
    table = stage_table(observation, rec.path if Part.OVERLAYS in contents.parts else None)
    rec.log(entities.TABLE, rr.TextDocument(table, media_type=rr.MediaType.MARKDOWN))
    if observation.trace.verdict is not None:
        rec.log(entities.VERDICT_FRAME, verdict_values(observation.trace.verdict))
    log_underlays(rec, observation, contents)
    _log_extrinsics(rec, observation)
    _log_camera(rec, observation)


def log_image(rec: Subtree, frame: Frame) -> None:
    """Log the image as the camera took it."""
    rec.log(entities.IMAGE, image_of(frame))


def image_of(frame: Frame) -> rr.EncodedImage | rr.Image:
    """The image as the camera took it, as a component."""
    return rr.Image(frame.as_taken.image).compress(jpeg_quality=JPEG_QUALITY)


def verdict_values(verdict: Verdict) -> rr.AnyValues:
    """A verdict as text, which `inspector.read.verdict.read_verdict` reads."""
    return rr.AnyValues(verdict_json=json.dumps(verdict.as_dict()))


def _log_extrinsics(rec: Subtree, observation: Observation) -> None:
    """Log every extrinsic in full precision, for reports and exports."""
    trace = observation.trace
    extrinsics = {entities.EXTRINSIC_INITIAL: trace.initial, entities.EXTRINSIC_CORRECTED: trace.corrected}
    extrinsics |= {entities.extrinsic_stage(stage.number): stage.after for stage in trace.stages}
    if observation.reference is not None:
        extrinsics[entities.EXTRINSIC_REFERENCE] = observation.reference
    for path, camera_from_lidar in extrinsics.items():
        rec.log(path, rr.AnyValues(camera_from_lidar=camera_from_lidar.astype(np.float64).ravel()))


def _log_camera(rec: Subtree, observation: Observation) -> None:
    """Log the camera, lens included, and the image's file name without its folder."""
    camera = observation.frame.as_taken.camera
    values = rr.AnyValues(
        width=camera.width,
        height=camera.height,
        camera_matrix=camera.matrix.astype(np.float64).ravel(),
        source=one_line(Path(observation.frame.source).name),
        lens_model=camera.model,
        lens_coefficients=camera.coefficients.astype(np.float64),
    )
    rec.log(entities.CAMERA, values)
