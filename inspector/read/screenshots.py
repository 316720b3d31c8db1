"""Pictures of a recording's tabs, taken in the real viewer without a window.

The README's pictures come from here (``calib-inspect pictures``), so they never age.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from PIL import Image

from calibnet.errors import ConfigError
from calibnet.runtime.writing import Kind, write_whole
from inspector import entities
from inspector.read.headless import DARK, HeadlessViewer, Page


def take_pictures(
    recording: Path,
    folder: Path,
    size: tuple[int, int],
    frame: int | None = None,
    wanted: Sequence[str] = (),
    theme: str = DARK,
) -> Iterator[Path]:
    """Take a picture of every page, or of the wanted ones; yields each file once it is written.

    Args:
        recording: an ``.rrd`` of ours.
        folder: folder for the pictures, created if missing.
        size: width and height in pixels.
        frame: number of the frame to show; None for the first, if the recording has frames.
        wanted: parts of pages' names, for instance ``"Overview"`` or ``"cost volumes stage 3"``.
        theme: theme of the viewer, ``dark`` or ``light``.

    Raises:
        ConfigError: the viewer does not start or does not load the recording, or the recording has no such frame.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with HeadlessViewer(*size, theme) as viewer:
        viewer.open(recording)
        frames = viewer.times(entities.FRAME)
        if frame is not None and (frames is None or not frames[0] <= frame <= frames[1]):
            known = "no frames" if frames is None else f"no frame {frame}, only {frames[0]} to {frames[1]}"
            raise ConfigError(f"{recording} has {known}.")
        if frames is not None:
            viewer.show_time(entities.FRAME, frames[0] if frame is None else frame)
        for page in viewer.pages():
            stem = file_stem(page)
            if not wanted or any(file_stem((part,)) in stem for part in wanted):
                viewer.show(page)
                file = folder / f"{stem or recording.stem}.png"  # a recording without tabs is one page
                write_whole(file, smaller(viewer.picture()), Kind.PNG)
                yield file


def smaller(png: bytes) -> bytes:
    """The same pixels in fewer bytes; the viewer writes fast, and compresses a seventh to a third less."""
    picture = Image.open(io.BytesIO(png)).convert("RGB")  # a window is opaque
    buffer = io.BytesIO()
    picture.save(buffer, "PNG", optimize=True)
    return min(png, buffer.getvalue(), key=len)


def file_stem(page: Page) -> str:
    """A file's name for a page, for instance ``cost-volumes-stage-3``."""
    words = re.sub(r"\(.*?\)", "", " ".join(page)).lower()
    return re.sub(r"[^a-z0-9]+", "-", words).strip("-")
