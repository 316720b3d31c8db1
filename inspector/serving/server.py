"""Serves the pages of one command while it runs, by default on this machine only.

The server is uvicorn and the apps are Starlette's, both of which handle ranges, slow clients and clients that hang up.
"""

from __future__ import annotations

import asyncio
import socket
import threading
import time
from collections.abc import Iterable
from ipaddress import IPv4Address, IPv6Address, ip_address
from pathlib import Path
from types import TracebackType

import uvicorn
from starlette.types import ASGIApp
from uvicorn.protocols.http.h11_impl import H11Protocol

from calibnet.errors import CalibnetError, ConfigError
from calibnet.runtime.text import one_line
from inspector.serving.guard import LOCALHOST, Guard, inline_scripts, new_token

PATIENCE_S = 10.0
KEEP_ALIVE_S = 15
"""Seconds that a client may take for its first request, and between requests."""
MOST_CONNECTIONS = 256
"""Largest number of open connections; further ones are told to try again."""


def bound_socket(bind: str) -> socket.socket:
    """A socket on a free port of an address of this machine.

    Raises:
        ConfigError: this machine has no such address.
    """
    opened = socket.socket(socket.AF_INET6 if ":" in bind else socket.AF_INET)
    try:
        if not bind.strip():  # the system would take it as every address
            raise ValueError
        opened.bind((bind, 0))
    except (OSError, UnicodeError, ValueError):
        opened.close()
        raise ConfigError(
            f"--bind {one_line(bind)[:100]!r} is not an address of this machine; give 127.0.0.1 for this machine only, "
            "or "
            "0.0.0.0 for every machine that can reach it."
        ) from None
    return opened


def host_of(address: IPv4Address | IPv6Address) -> str:
    """The host of a URL that reaches a server at an address; this machine's name if it listens on all addresses."""
    if not address.is_unspecified:
        return str(address) if address.version == 4 else f"[{address}]"
    name = socket.gethostname()
    try:
        socket.getaddrinfo(name, None)
    except OSError:
        return LOCALHOST
    return name


class Punctual(H11Protocol):
    """A connection that is closed if its client sends no request in time; uvicorn waits for the first one forever."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]  # as uvicorn has it
        """Begin to wait."""
        super().connection_made(transport)
        self.loop.call_later(self.timeout_keep_alive, self._hang_up)

    def _hang_up(self) -> None:
        still_open = self in self.connections  # and not a websocket by now
        if still_open and not self.cycle:
            self.transport.close()


class PageServer:
    """A context manager that serves an app.

    Attributes:
        address: address of the app's root, with the token.
    """

    def __init__(self, app: ASGIApp, bind: str = LOCALHOST, data: str = "", pages: Iterable[Path] = ()) -> None:
        """Listen on a free port; `inspector.serving.guard.Guard` stands before the app.

        Args:
            app: app to serve.
            bind: address of this machine to listen on; if other machines reach it, whoever has the token may connect.
            data: see `Guard`.
            pages: HTML files of the app that have scripts within them, see `inspector.serving.guard.inline_scripts`.

        Raises:
            ConfigError: this machine has no such address.
        """
        self._socket = bound_socket(bind)
        address, port, *_ = self._socket.getsockname()
        token, here = new_token(), ip_address(address)
        host = host_of(here)
        self.address = f"http://{host}:{port}/{token}/"
        only_here, scripts = host if here.is_loopback else None, inline_scripts(*pages)
        config = uvicorn.Config(
            Guard(app, port, token, only_here=only_here, data=data, scripts=scripts),
            http=Punctual,
            lifespan="off",
            log_config=None,
            access_log=False,
            server_header=False,
            timeout_keep_alive=KEEP_ALIVE_S,
            timeout_graceful_shutdown=1,
            limit_concurrency=MOST_CONNECTIONS,
            ws_max_size=1 << 20,
        )
        self._server = uvicorn.Server(config)
        self._thread = threading.Thread(target=self._server.run, args=([self._socket],), daemon=True)

    def __enter__(self) -> PageServer:
        self._thread.start()
        deadline = time.monotonic() + PATIENCE_S
        while not self._server.started:
            if not self._thread.is_alive() or time.monotonic() > deadline:
                raise CalibnetError("The page server did not start; free some memory or ports, and try again.")
            time.sleep(0.01)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._server.should_exit = True
        self._thread.join(PATIENCE_S)
        self._socket.close()
