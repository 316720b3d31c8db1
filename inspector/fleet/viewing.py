"""Opens a viewer on an address of Rerun's server, as a window or as a page in a browser."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from urllib.parse import quote, urlsplit

from starlette.applications import Starlette

from calibnet.errors import ConfigError
from inspector.programs import open_window
from inspector.record.outputs import has_display
from inspector.serving.files import file_route
from inspector.serving.server import PageServer
from inspector.serving.viewer_files import INDEX, fetch_viewer, viewer_files


@contextmanager
def open_viewer(address: str, in_browser: bool, headless: bool) -> Iterator[str]:
    """Open a viewer, and yield a line on where it is or how to open one; a web server of ours ends with the context.

    Args:
        address: address that it shows.
        in_browser: whether to serve the web viewer, behind the guard of all pages, instead of opening a window.
        headless: whether to open no window.
    """
    if in_browser:
        data = f"http://{urlsplit(address).netloc}"
        with TemporaryDirectory(prefix="calib-inspect-") as folder:
            fetch_viewer(Path(folder))
            app = Starlette(routes=[file_route(viewer_files(Path(folder)))])
            with PageServer(app, data=data, pages=[Path(folder) / INDEX]) as server:
                yield f"In a browser: {server.address}?url={quote(address, safe='')}&hide_welcome_screen=1"
        return
    opened = False
    if has_display() and not headless:
        with suppress(ConfigError, subprocess.SubprocessError):
            open_window(address)
            opened = True
    yield "The viewer has opened." if opened else f"Open it with: rerun {address}"
