"""A viewer on an address of Rerun's server: a window, or a page in a browser."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from urllib.parse import quote

from calibnet.errors import ConfigError
from inspector.programs import LOCALHOST, free_port, rerun_binary, start_program
from inspector.record.outputs import has_display


@contextmanager
def open_viewer(address: str, in_browser: bool, headless: bool) -> Iterator[str]:
    """Open one, and say where it is or how to open one; a web server of ours ends with the context.

    Args:
        address: what it shows.
        in_browser: serve the web viewer instead of opening a window.
        headless: open no window.
    """
    if in_browser:
        port, web_port = free_port(), free_port()
        ports = ["--port", str(port), "--web-viewer-port", str(web_port)]
        server = start_program([rerun_binary(), "--serve-web", "--bind", LOCALHOST, *ports], web_port)
        try:
            yield f"In a browser: http://{LOCALHOST}:{web_port}/?url={quote(address, safe='')}"
        finally:
            server.terminate()
            server.wait()
        return
    if has_display() and not headless:
        port = free_port()
        command = [rerun_binary(), address, "--port", str(port), "--bind", LOCALHOST, "--hide-welcome-screen"]
        try:
            start_program(command, port, outlives_us=True)
            yield "The viewer has opened."
            return
        except (ConfigError, subprocess.SubprocessError):
            pass
    yield f"Open it with: rerun {address}"
