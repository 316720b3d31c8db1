"""The app of the page: the page and its image over HTTP, messages and the recording over websockets."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from inspector.live.payload import picture_jpeg, points_bytes
from inspector.live.session import LiveSession
from inspector.live.stream import TryStream
from inspector.serving.files import file_route
from inspector.serving.viewer_files import VIEWER_FILES

PAGE = Path(__file__).parent / "page"


class LiveApp:
    """Connects browser windows to a session; all of them show the same."""

    def __init__(self, session: LiveSession, viewer: Path) -> None:
        """Serve a session.

        Args:
            session: the session.
            viewer: folder with the files of Rerun's web viewer.
        """
        assert isinstance(session.stream, TryStream), "a page's viewer gets pieces"
        self._session, self._recorded = session, session.stream
        self._windows: set[WebSocket] = set()
        self._viewers: set[asyncio.Event] = set()
        session.tell = self._tell_all
        session.on_recorded(self._wake)
        files = {f"/{file.name}": file for file in PAGE.iterdir() if file.is_file()}
        files |= {f"/viewer/{name}": viewer / name for name in VIEWER_FILES if name != "index.html"}
        files |= {"/": PAGE / "live.html", "/viewer/": PAGE / "viewer.html", "/viewer/viewer.js": PAGE / "viewer.js"}
        self.asgi = Starlette(
            routes=[
                Route("/picture.jpg", self._answer(picture_jpeg, "image/jpeg")),
                Route("/points.bin", self._answer(points_bytes, "application/octet-stream")),
                WebSocketRoute("/control", self._control),
                WebSocketRoute("/stream", self._stream),
                file_route(files),
            ]
        )

    def _answer(self, make: Callable[[Any], bytes], media_type: str) -> Callable[[Request], Awaitable[Response]]:
        """A handler on the current frame; the page adds the position to the URL, so that no old answer is shown."""

        async def answer(_: Request) -> Response:
            content = await asyncio.to_thread(make, self._session.workspace.frame)
            return Response(content, media_type=media_type, headers={"cache-control": "no-store"})

        return answer

    async def _control(self, window: WebSocket) -> None:
        """Exchange JSON messages with a window."""
        await window.accept()
        hello = self._session.hello()
        self._windows.add(window)  # before anything else is sent, so that what hello lacks follows it
        await window.send_json(hello)
        self._session.opened()
        try:
            while (received := await window.receive())["type"] == "websocket.receive":
                answer = await self._session.hear(received.get("text") or received.get("bytes") or b"")
                if answer is not None:
                    await window.send_json(answer)
        except (WebSocketDisconnect, RuntimeError):
            pass
        finally:
            self._windows.discard(window)

    async def _stream(self, viewer: WebSocket) -> None:
        """Send the viewer the pieces of the recording that it lacks, and then each new one."""
        await viewer.accept()
        had = viewer.query_params.get("from", "0")
        more, sent = asyncio.Event(), int(had) if had.isdecimal() and len(had) < 10 else 0
        self._viewers.add(more)
        gone = asyncio.create_task(_until_gone(viewer))
        gone.add_done_callback(lambda _: more.set())
        try:
            while not gone.done():
                more.clear()
                while sent < len(self._recorded):
                    await viewer.send_bytes(await asyncio.to_thread(self._recorded.piece, sent))
                    sent += 1
                await more.wait()
        except (WebSocketDisconnect, RuntimeError):
            pass
        finally:
            self._viewers.discard(more)
            gone.cancel()

    async def _wake(self) -> None:
        for more in self._viewers:
            more.set()

    async def _tell_all(self, message: dict[str, Any]) -> None:
        """Send a message to every window, and forget windows that are gone."""
        text = json.dumps(message)
        for window in list(self._windows):
            try:
                await window.send_text(text)
            except (WebSocketDisconnect, RuntimeError):
                self._windows.discard(window)


async def _until_gone(socket: WebSocket) -> None:
    try:
        while True:
            await socket.receive()
    except (WebSocketDisconnect, RuntimeError):
        return
