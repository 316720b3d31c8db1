"""An animation of a run: some frames before the correction and after every stage."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from calibnet.errors import ConfigError
from calibnet.geometry import MiscalibrationRange
from calibnet.geometry.types import Extrinsic
from calibnet.runtime.writing import Kind, write_whole
from inspector import entities
from inspector.read.run import RecordedFrame, RecordedRun
from inspector.report.pictures import draw_overlay

FORMATS: Final[dict[str, dict[str, Any]]] = {".webp": {"quality": 60, "method": 4}, ".gif": {"optimize": True}}
"""File name suffixes, and the options with which Pillow writes each format."""
WIDTH: Final = 800
CAPTION_HEIGHT: Final = 30
FONT_SIZE: Final = 16
MARGIN: Final = 10
BACKGROUND: Final = (24, 24, 27)
TEXT: Final = (240, 240, 240)
FIRST_MS, STAGE_MS, LAST_MS = 1600, 900, 2600
"""Durations of the start, a stage and the result of a frame, in milliseconds."""
FRAMES: Final = 3
"""Default number of frames of a run that are shown."""


class Step(NamedTuple):
    """One still of the animation.

    Attributes:
        overlay: entity of the recording whose points are drawn.
        name: name of the extrinsic.
        error: its error against the reference, in words; empty without a reference.
        milliseconds: duration of the still.
    """

    overlay: str
    name: str
    error: str
    milliseconds: int


def spread(run: RecordedRun, count: int = FRAMES) -> list[int]:
    """Numbers of at most ``count`` frames, evenly spread over the run, first and last among them."""
    positions = np.unique(np.linspace(0, len(run.frames) - 1, min(count, len(run.frames))).round().astype(int))
    return [run.frames[position].index for position in positions]


def write_animation(run: RecordedRun, file: Path, frames: Sequence[int]) -> None:
    """Write an endless animation of some frames of a run.

    Args:
        run: run with recorded overlays after every stage (``--log overlays`` or more).
        file: file to write, ``.webp`` or ``.gif``; GIF has 256 colours and is several times as large.
        frames: numbers of frames of the run; at least one.

    Raises:
        ConfigError: the file has another suffix.
        RecordingError: the recording lacks the overlay of a frame and stage.
        OSError: the file cannot be written.
    """
    kind = file.suffix.lower()
    if kind not in FORMATS:
        raise ConfigError(f"{file} is not a .webp or .gif file; give a name with one of these endings.")
    recorded = {frame.index: frame for frame in run.frames}
    steps = [(frame, step) for frame in (recorded[index] for index in frames) for step in steps_of(run, frame)]
    pictures = [_still(run, frame, step) for frame, step in steps]
    durations = [step.milliseconds for _, step in steps]
    encoded = io.BytesIO()
    pictures[0].save(
        encoded, kind[1:], save_all=True, append_images=pictures[1:], duration=durations, loop=0, **FORMATS[kind]
    )
    write_whole(file, encoded.getvalue(), Kind[kind[1:].upper()])


def steps_of(run: RecordedRun, frame: RecordedFrame) -> Iterator[Step]:
    """The start, every stage, and the result if that is not the last stage's."""
    start = "miscalibrated" if run.has_reference else "as given"
    yield Step(entities.OVERLAY_MISCALIBRATED, start, _error(frame, frame.initial), FIRST_MS)
    for stage in run.stages:
        last = not frame.rejected and stage == run.stages[-1]
        name = f"after stage {stage.number} (for {MiscalibrationRange.parse(stage.range).label})"
        error = _error(frame, frame.stages[stage.number])
        yield Step(entities.overlay_stage(stage.number), name, error, LAST_MS if last else STAGE_MS)
    if frame.rejected:
        name = "rejected, left as it was"
        yield Step(entities.OVERLAY_CORRECTED, name, _error(frame, frame.corrected), LAST_MS)


def _error(frame: RecordedFrame, camera_from_lidar: Extrinsic) -> str:
    error = frame.error(camera_from_lidar)
    return "" if error is None else f"{error.rotation_deg:.2f}° and {error.translation_cm:.0f} cm off"


def _still(run: RecordedRun, frame: RecordedFrame, step: Step) -> Image.Image:
    """The frame's image with the points under one extrinsic, below a line with its name and error."""
    points = run.overlay(step.overlay, frame.index)
    size = (frame.camera.width, frame.camera.height)
    drawn = Image.open(io.BytesIO(draw_overlay(run.image(frame.index), points.uv, points.rgb, size)))
    overlay = drawn.resize((WIDTH, round(drawn.height * WIDTH / drawn.width)), Image.Resampling.LANCZOS)
    picture = Image.new("RGB", (WIDTH, CAPTION_HEIGHT + overlay.height), BACKGROUND)
    picture.paste(overlay, (0, CAPTION_HEIGHT))
    write = partial(ImageDraw.Draw(picture).text, fill=TEXT, font=ImageFont.load_default(FONT_SIZE))
    middle = CAPTION_HEIGHT // 2
    write((MARGIN, middle), f"Frame {frame.index}, {step.name}", anchor="lm")
    write((WIDTH - MARGIN, middle), step.error, anchor="rm")
    return picture
