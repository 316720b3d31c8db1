"""A recording in Rerun's web viewer, which is given it over HTTP while it grows: no port of Rerun's is opened."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import AsyncIterator
from pathlib import Path
from typing import TYPE_CHECKING

from starlette.applications import Starlette
from starlette.responses import StreamingResponse
from starlette.routing import Route

from inspector.serving.files import file_route
from inspector.serving.viewer_files import viewer_files

if TYPE_CHECKING:
    from starlette.requests import Request

RECORDING = "recording.rrd"
PIECE_BYTES = 1 << 20
PAUSE_S = 0.1
"""Pause between checks whether the file has grown."""


def recording_app(file: Path, viewer: Path, begun: threading.Event, ended: threading.Event) -> Starlette:
    """The app for `inspector.serving.server.PageServer`.

    Args:
        file: the recording; it may be replaced as a whole while it is given out.
        viewer: folder with the files of Rerun's web viewer.
        begun: set when the file, as soon as there is one, is the recording's; one that was there before is not given
            out.
        ended: set when the recording grows no more.
    """

    async def answer(_: Request) -> StreamingResponse:
        return StreamingResponse(_growing(file, begun, ended), media_type="application/octet-stream")

    return Starlette(routes=[Route(f"/{RECORDING}", answer), file_route(viewer_files(viewer))])


async def _growing(path: Path, begun: threading.Event, ended: threading.Event) -> AsyncIterator[bytes]:
    while not (begun.is_set() and path.exists()):
        if ended.is_set():
            return
        await asyncio.sleep(PAUSE_S)
    with path.open("rb") as file:
        while True:
            last = ended.is_set()  # asked before the file is read, so that nothing written in between is lost
            piece = await asyncio.to_thread(file.read, PIECE_BYTES)
            if piece:
                yield piece
            elif last:
                return
            else:
                await asyncio.sleep(PAUSE_S)
