"""The files of Rerun's web viewer, fetched from the web server of the installed Rerun."""

from __future__ import annotations

import urllib.request
from pathlib import Path
from urllib.error import URLError

from calibnet.errors import CalibnetError
from calibnet.runtime.writing import write_whole
from inspector.programs import LOCALHOST, free_port, rerun_binary, start_program

QUIET = b"console.debug = () => {};\n"
"""Prepended to the viewer's program, whose 15,000 log lines about its shaders take longer than compiling them."""
INDEX = "index.html"
VIEWER_FILES = (INDEX, "re_viewer.js", "re_viewer_bg.wasm", "favicon.ico")


def viewer_files(folder: Path) -> dict[str, Path]:
    """The files that `fetch_viewer` put into a folder, by the paths of their URLs."""
    return {"/": folder / INDEX, **{f"/{name}": folder / name for name in VIEWER_FILES}}


class ViewerFilesError(CalibnetError):
    """The web viewer's files cannot be fetched from the installed Rerun."""


def fetch_viewer(folder: Path) -> None:
    """Get the web viewer's files (43 MB) from the installed Rerun.

    Raises:
        CalibnetError: Rerun does not start, or lacks them.
    """
    port, web_port = free_port(), free_port()
    ports = ["--port", str(port), "--web-viewer-port", str(web_port)]
    server = start_program([rerun_binary(), "--serve-web", "--bind", LOCALHOST, *ports], web_port)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name in VIEWER_FILES:
            address = f"http://{LOCALHOST}:{web_port}/{name}"
            with urllib.request.urlopen(address, timeout=60) as answer:
                write_whole(folder / name, (QUIET if name == "re_viewer.js" else b"") + answer.read())
    except URLError as error:
        raise ViewerFilesError(
            f"The web viewer could not be fetched from the installed Rerun ({error.reason}); reinstall rerun-sdk."
        ) from None
    finally:
        server.terminate()
        server.wait()
