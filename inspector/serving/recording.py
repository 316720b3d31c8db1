"""Serves a growing recording to Rerun's web viewer over HTTP, without opening a port of Rerun's."""

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
"""Pause between checks whether the file has grown, in seconds."""


def recording_app(file: Path, viewer: Path, begun: threading.Event, ended: threading.Event) -> Starlette:
    """The app for `inspector.serving.server.PageServer`.

    Args:
        file: the recording, which may be replaced as a whole while it is served.
        viewer: folder with the files of Rerun's web viewer.
        begun: set once the file is the new recording; a file that existed before is not served.
        ended: set once the recording is complete.
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
            last = ended.is_set()  # checked before the file is read, so that nothing written in between is lost
            piece = await asyncio.to_thread(file.read, PIECE_BYTES)
            if piece:
                yield piece
            elif last:
                return
            else:
                await asyncio.sleep(PAUSE_S)
