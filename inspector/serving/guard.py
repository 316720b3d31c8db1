"""Guards every page: requests from elsewhere or without the token are refused.

A web page could let a name of its own resolve to 127.0.0.1 and read what is served here, so the Host header has to name
this server. Other users of this machine can reach it as well, so every path begins with a random token, which only the
printed address has. A content security policy forbids pages to load anything from elsewhere.
"""

from __future__ import annotations

import re
import secrets
from base64 import b64encode
from hashlib import sha256
from pathlib import Path
from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocketClose

LOCALHOST = "127.0.0.1"
TOKEN_BYTES = 18
NOT_FOUND = "Not found. Open the address that calib-inspect printed when it started; every start has a new one."
FORBIDDEN = "Forbidden. Open the address that calib-inspect printed when it started, exactly as it is."


def new_token() -> str:
    """A random part of a path that cannot be guessed."""
    return secrets.token_urlsafe(TOKEN_BYTES)


def inline_scripts(*pages: Path) -> str:
    """What a policy names the scripts within HTML files by, so that they run, and one that was slipped in does not."""
    texts = (page.read_text("utf-8") for page in pages)
    scripts = (script for text in texts for script in re.findall(r"<script>(.*?)</script>", text, re.DOTALL))
    return " ".join(f"'sha256-{b64encode(sha256(script.encode()).digest()).decode()}'" for script in scripts)


class Guard:
    """ASGI middleware that checks Host, Origin and token, and takes the token off the path."""

    def __init__(
        self,
        app: ASGIApp,
        port: int,
        token: str,
        only_here: str | None = LOCALHOST,
        data: str = "",
        scripts: str = "",
    ) -> None:
        """Guard an app.

        Args:
            app: app to guard, which sees paths without the token.
            port: port on which the server listens.
            token: token from `new_token`.
            only_here: host of the server's address if only this machine reaches it; None if others do as well, so that
                the server may have any name and only the token is checked.
            data: address, without a path, of another server of ours from which pages may load.
            scripts: hashes from `inline_scripts` of the scripts within the app's pages.
        """
        self._app, self._only_here = app, only_here
        self._hosts = {f"{host}:{port}" for host in (only_here or LOCALHOST, LOCALHOST, "localhost")}
        self._token = token
        live, pages = (" ".join(f"{scheme}://{host}" for host in sorted(self._hosts)) for scheme in ("ws", "http"))
        self._headers = {
            "content-security-policy": "default-src 'self' data: blob:; style-src 'self' 'unsafe-inline'; "
            f"object-src 'none'; script-src 'self' 'wasm-unsafe-eval' {scripts}; "
            f"connect-src 'self' data: blob: {live} {data}; frame-src {pages}; frame-ancestors {pages}; "
            "form-action 'self'; base-uri 'none'",
            "cross-origin-resource-policy": "same-origin",
            "referrer-policy": "no-referrer",
            "x-content-type-options": "nosniff",
        }

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer 403 to foreign hosts and origins and 404 without the token; refuse their websockets."""
        headers = Headers(scope=scope)
        origin = headers.get("origin")
        hosts = self._hosts if self._only_here else {headers.get("host", "")}
        allowed = headers.get("host") in hosts and (origin is None or urlsplit(origin).netloc in hosts)
        token, _, path = str(scope["path"]).lstrip("/").partition("/")
        known = secrets.compare_digest(token.encode(), self._token.encode())
        if not (allowed and known):
            refusal = PlainTextResponse(FORBIDDEN, 403) if not allowed else PlainTextResponse(NOT_FOUND, 404)
            refused: ASGIApp = WebSocketClose() if scope["type"] == "websocket" else refusal
            await refused(scope, receive, send)
            return

        async def send_guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                MutableHeaders(scope=message).update(self._headers)
            await send(message)

        inner = dict(scope) | {"path": f"/{path}", "raw_path": f"/{path}".encode()}
        await self._app(inner, receive, send_guarded)
