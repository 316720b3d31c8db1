"""What stands before every page: requests from elsewhere and without the token get nothing.

A page on the web could let a name of its own point to 127.0.0.1 and read what is served here, so the Host header has to
name this server. Other users of this machine can reach it as well, so every path begins with a random token, which only
the printed address has. Answers forbid pages to load anything from elsewhere.
"""

from __future__ import annotations

import secrets
from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocketClose

LOCALHOST = "127.0.0.1"
TOKEN_BYTES = 18


def new_token() -> str:
    """A path part that nobody can guess."""
    return secrets.token_urlsafe(TOKEN_BYTES)


class Guard:
    """ASGI middleware that checks Host, Origin and token, and takes the token off the path."""

    def __init__(self, app: ASGIApp, port: int, token: str, only_here: str | None = LOCALHOST, data: str = "") -> None:
        """Stand before an app.

        Args:
            app: knows nothing of the token.
            port: that the server listens on.
            token: of `new_token`.
            only_here: host of the server's address, which only this machine reaches; None where others do as well: it
                may have any name then, and the token alone is asked for.
            data: address of a server of ours, without a path, that pages may load from as well.
        """
        self._app, self._only_here = app, only_here
        self._hosts = {f"{host}:{port}" for host in (only_here or LOCALHOST, LOCALHOST, "localhost")}
        self._token = token
        live, pages = (" ".join(f"{scheme}://{host}" for host in sorted(self._hosts)) for scheme in ("ws", "http"))
        self._headers = {
            "content-security-policy": "default-src 'self' 'unsafe-inline' 'wasm-unsafe-eval' data: blob:; "
            f"connect-src 'self' data: blob: {live} {data}; frame-src {pages}; frame-ancestors {pages}; "
            "form-action 'self'; base-uri 'none'",
            "cross-origin-resource-policy": "same-origin",
            "referrer-policy": "no-referrer",
            "x-content-type-options": "nosniff",
        }

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer 403 to strangers and 404 without the token; a websocket of theirs is not opened."""
        headers = Headers(scope=scope)
        origin = headers.get("origin")
        hosts = self._hosts if self._only_here else {headers.get("host", "")}
        allowed = headers.get("host") in hosts and (origin is None or urlsplit(origin).netloc in hosts)
        token, _, path = str(scope["path"]).lstrip("/").partition("/")
        known = secrets.compare_digest(token.encode(), self._token.encode())
        if not (allowed and known):
            refusal = PlainTextResponse("Forbidden", 403) if not allowed else PlainTextResponse("Not found", 404)
            refused: ASGIApp = WebSocketClose() if scope["type"] == "websocket" else refusal
            await refused(scope, receive, send)
            return

        async def send_guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                MutableHeaders(scope=message).update(self._headers)
            await send(message)

        inner = dict(scope) | {"path": f"/{path}", "raw_path": f"/{path}".encode()}
        await self._app(inner, receive, send_guarded)
