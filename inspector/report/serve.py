"""A small web server for one report and the embedded viewer, on this machine only.

It knows a fixed list of files and gives out nothing else, so the report's folder may hold what it
wants. Requests that name another host are refused: a page on the web could otherwise read the
report through a name that it lets point here.
"""

from __future__ import annotations

import contextlib
import http.server
import shutil
import threading
import urllib.request
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from urllib.error import URLError
from urllib.parse import unquote, urlsplit

from calibnet.errors import CalibnetError
from inspector.record.outputs import LOCALHOST, Outputs
from inspector.report.write import METRICS, PAGE, PICTURES, RECORDING, VIEWER

VIEWER_FILES = ("index.html", "re_viewer.js", "re_viewer_bg.wasm", "favicon.ico")
MEDIA_TYPES = {
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript",
    ".json": "application/json",
    ".jpg": "image/jpeg",
    ".wasm": "application/wasm",
    ".ico": "image/x-icon",
}


POLICY = "default-src 'self' 'unsafe-inline' 'unsafe-eval' data: blob:"
"""What pages may load: nothing from elsewhere. Rerun's viewer would send its usage to its makers."""


class ViewerFilesError(CalibnetError):
    """The web viewer's files cannot be had from the installed Rerun."""


def fetch_viewer(folder: Path) -> None:
    """Get the web viewer's files (43 MB) from the installed Rerun, which only hands them out as a web server.

    Raises:
        CalibnetError: Rerun does not start, or does not have them.
    """
    outputs = Outputs(serve=True)
    try:
        outputs.open()
        address, _, _ = str(outputs.page).partition("?")
        folder.mkdir(parents=True, exist_ok=True)
        for name in VIEWER_FILES:
            with urllib.request.urlopen(f"{address}{name}", timeout=60) as answer, (folder / name).open("wb") as file:
                shutil.copyfileobj(answer, file)
    except URLError as error:
        raise ViewerFilesError(
            f"The installed Rerun does not hand out its web viewer ({error.reason}); reinstall rerun-sdk."
        ) from None
    finally:
        outputs.close()


def served_files(report: Path, viewer: Path) -> dict[str, Path]:
    """What the server gives out: path of the address to file."""
    files = {f"/{name}": report / name for name in (PAGE, METRICS, RECORDING)}
    files |= {f"/{PICTURES}/{picture.name}": picture for picture in (report / PICTURES).glob("*.jpg")}
    files |= {f"/{VIEWER}/{name}": viewer / name for name in VIEWER_FILES}
    return {"/": report / PAGE, f"/{VIEWER}/": viewer / PAGE, **files}


class ReportServer:
    """Serves while it is entered as a context."""

    def __init__(self, files: Mapping[str, Path]) -> None:
        """Listen on a free port of this machine; see `served_files`."""
        handler = type("Handler", (_Handler,), {"files": files})
        self._server = http.server.ThreadingHTTPServer((LOCALHOST, 0), handler)
        self.address = f"http://{LOCALHOST}:{self._server.server_port}/"

    def __enter__(self) -> ReportServer:
        threading.Thread(target=self._server.serve_forever, daemon=True).start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._server.shutdown()
        self._server.server_close()


class _Handler(http.server.BaseHTTPRequestHandler):
    files: Mapping[str, Path] = {}

    def do_GET(self) -> None:
        """Answer with the file."""
        self._answer(with_content=True)

    def do_HEAD(self) -> None:
        """Answer whether it exists."""
        self._answer(with_content=False)

    def _answer(self, with_content: bool) -> None:
        if self.headers.get("Host", "").partition(":")[0] not in (LOCALHOST, "localhost"):
            self.send_error(403)
            return
        file = self.files.get(unquote(urlsplit(self.path).path))
        if file is None or not file.is_file():
            self.send_error(404)
            return
        with file.open("rb") as content:
            self.send_response(200)
            self.send_header("Content-Type", MEDIA_TYPES.get(file.suffix, "application/octet-stream"))
            self.send_header("Content-Security-Policy", POLICY)
            self.send_header("Content-Length", str(file.stat().st_size))
            self.end_headers()
            if with_content:
                with contextlib.suppress(ConnectionError):  # the page was closed while it loaded
                    shutil.copyfileobj(content, self.wfile)

    def log_message(self, format: str, *_: object) -> None:
        """Say nothing: the terminal is for the address."""
