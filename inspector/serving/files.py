"""Serves a fixed list of files, whatever else is in their folders."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import FileResponse
from starlette.routing import Route

MEDIA_TYPES = {
    ".css": "text/css; charset=utf-8",
    ".html": "text/html; charset=utf-8",
    ".ico": "image/x-icon",
    ".jpg": "image/jpeg",
    ".js": "text/javascript",
    ".json": "application/json",
    ".wasm": "application/wasm",
}


def file_route(files: Mapping[str, Path]) -> Route:
    """A route that serves files, and answers everything else with 404.

    Args:
        files: files by the path of their URL, which begins with ``/``.
    """

    async def answer(request: Request) -> FileResponse:
        file = files.get(request.url.path)
        if file is None or not file.is_file():
            raise HTTPException(404)
        return FileResponse(file, media_type=MEDIA_TYPES.get(file.suffix, "application/octet-stream"))

    return Route("/{path:path}", answer)
