"""Writes a report: pictures, figures and the recording first, then the page that shows them."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from calibnet.errors import ConfigError
from calibnet.runtime.claim import Claim
from calibnet.runtime.writing import Kind, write_whole
from inspector import entities
from inspector.read.pictures import OverlayPoints
from inspector.read.run import RecordedFrame, RecordedRun
from inspector.read.understood import RecordingError
from inspector.report.files import ALONE, AS_ONE, CORRECTED, LEFT, METRICS, PAGE, PICTURES, RECORDING, picture_file
from inspector.report.metrics import Figures
from inspector.report.page import Example, make_page
from inspector.report.pictures import draw_overlay

Shown = TypeVar("Shown")


def check_folder(folder: Path) -> None:
    """Create the report's folder, so that a failure shows before the work.

    Raises:
        ConfigError: the folder cannot be written.
    """
    try:
        (folder / PICTURES).mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder / PICTURES):
            pass
    except OSError as error:
        raise cannot_write(error, folder) from None


def write_report(run: RecordedRun, folder: Path) -> Path:
    """Write the report of a run; existing files are replaced only by files of the same names.

    Args:
        run: the recording.
        folder: created if it does not exist.

    Returns:
        The page.

    Raises:
        ConfigError: the folder cannot be written, for instance because the disk is full.
        CalibnetError: a picture of the recording cannot be read.
    """
    figures = Figures.of(run)

    def draw() -> list[Example]:
        return [_write_pictures(run, name, position, folder) for name, position in figures.examples().items()]

    return write_files(
        folder, run.path, draw, _json(figures.as_dict()), lambda shown, size: make_page(figures, shown, RECORDING, size)
    )


def write_files(
    folder: Path, recording: Path, draw: Callable[[], Shown], metrics: str, page: Callable[[Shown, int], str]
) -> Path:
    """Write the files of a report, the page last, so that it never refers to missing files.

    Args:
        folder: created if it does not exist.
        recording: recording to copy into the folder.
        draw: writes the pictures, and returns their description for the page.
        metrics: content of ``metrics.json``.
        page: makes the page from the description of the pictures and the recording's size in bytes.

    Returns:
        The page.

    Raises:
        ConfigError: the folder cannot be written, for instance because the disk is full.
    """
    check_folder(folder)
    claim = Claim(folder / PAGE, Kind.PAGE)
    try:
        shown = draw()
        write_whole(folder / METRICS, metrics.encode(), Kind.JSON)
        copy_recording(recording, folder / RECORDING)
        text = page(shown, (folder / RECORDING).stat().st_size)
        write_whole(folder / PAGE, text.encode(errors="backslashreplace"), Kind.PAGE)
    except OSError as error:
        raise cannot_write(error, folder) from None
    finally:
        claim.release()
    return folder / PAGE


def _json(content: Mapping[str, Any]) -> str:
    """Indented JSON with one line per frame, so that a long run stays readable."""
    frames = ",\n  ".join(json.dumps(frame, allow_nan=False) for frame in content["per_frame"])
    head = json.dumps({**content, "per_frame": []}, indent=1, allow_nan=False)
    return head.removesuffix("[]\n}") + f"[\n  {frames}\n ]\n}}\n"


def copy_recording(source: Path, target: Path) -> None:
    """Copy the recording beside the page, unless it is there already.

    It is not a hard link, since the next run that records to the same path would then write into the report.
    """
    if not (target.exists() and target.samefile(source)):
        claim = Claim(target, Kind.RECORDING)  # another run may be recording to it
        try:
            write_whole(target, lambda partial: shutil.copyfile(source, partial), Kind.RECORDING)
        finally:
            claim.release()


def _write_pictures(run: RecordedRun, name: str, position: int, folder: Path) -> Example:
    """Draw one frame before, after and, if known, under the reference."""
    index = run.frames[position].index
    camera, image = run.frames[position].camera, run.image(index)
    size = (camera.width, camera.height)
    files = {}
    for shown, points in _overlays(run, run.frames[position]).items():
        files[shown] = picture_file(name, shown)
        write_whole(folder / files[shown], draw_overlay(image, *points, size), Kind.JPEG)
    return Example(name, position, files)


def _overlays(run: RecordedRun, frame: RecordedFrame) -> Mapping[str, OverlayPoints]:
    """The overlays of a frame by name, the result last, which is the drive's if it is not rejected and has points."""
    index = frame.index
    start = "miscalibrated" if run.has_reference else "start"
    shown = {start: run.overlay(entities.OVERLAY_MISCALIBRATED, index)}
    if run.has_reference:
        shown["reference"] = run.overlay(entities.OVERLAY_REFERENCE, index)
    own = run.overlay(entities.OVERLAY_CORRECTED, index)
    if run.believes_drive:
        with contextlib.suppress(RecordingError):  # this frame has no overlay of the drive
            return shown | {ALONE: own, AS_ONE: run.overlay(entities.OVERLAY_DRIVE, index)}
    return shown | {LEFT if frame.rejected else CORRECTED: own}


def cannot_write(error: OSError, folder: Path) -> ConfigError:
    """The error for a report's folder that cannot be written."""
    reason = os.strerror(error.errno) if error.errno else str(error)
    return ConfigError(
        f"{error.filename or folder} cannot be written ({reason}); free some space or choose another folder."
    )
