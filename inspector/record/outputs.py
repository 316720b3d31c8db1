"""Outputs of a recording: a file, a viewer on this machine, a web viewer, or a running viewer elsewhere."""

from __future__ import annotations

import os
import platform
import re
import shutil
import tempfile
import threading
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import quote, urlsplit

import rerun as rr

from calibnet.errors import ConfigError
from calibnet.runtime.claim import Claim
from calibnet.runtime.interruption import StopRequest
from calibnet.runtime.writing import Kind
from inspector.programs import LOCALHOST, SWITCHED_OFF, listening, open_window

RESERVE_BYTES = 32 * 1024 * 1024
"""Free disk space below which recording stops, so that the current data can still be written."""


@dataclass
class Outputs:
    """The sinks of one recording, and the servers and processes that they need.

    Attributes:
        file: ``.rrd`` to write; an earlier one is moved aside at the first frame, and removed by `complete`.
        viewer: whether to open the viewer in a window.
        serve: whether to serve the web viewer, behind the guard of all pages.
        connect: gRPC address of a running viewer.
        bind: address on which the web viewer is served.
        numbered: whether ``file`` was chosen by us, and gets a number if a file of this name exists.
        replaced: whether `complete` has removed an earlier recording.
        page: address of the web viewer, once it is served.
    """

    file: Path | None = None
    viewer: bool = False
    serve: bool = False
    connect: str | None = None
    bind: str = LOCALHOST
    numbered: bool = False
    replaced: bool = field(default=False, init=False)
    _claim: Claim | None = field(default=None, init=False, repr=False)
    page: str | None = field(default=None, init=False)
    _serving: ExitStack = field(default_factory=ExitStack, init=False, repr=False)
    _begun: threading.Event = field(default_factory=threading.Event, init=False, repr=False)
    _ended: threading.Event = field(default_factory=threading.Event, init=False, repr=False)
    _shown: list[Any] | None = field(default=None, init=False, repr=False)

    def check(self) -> None:
        """Check before the work that the outputs can be opened, and claim the file until `close`.

        Raises:
            ConfigError: the file must not or cannot be written, nothing listens at ``connect``, or ``bind`` is not an
                address of this machine.
        """
        if os.environ.get("RERUN", "").lower() in SWITCHED_OFF:
            raise ConfigError(
                "The environment variable RERUN switches Rerun off, so nothing would be recorded; unset it."
            )
        if self.connect is not None:
            check_viewer(self.connect)
        if self.serve:
            from inspector.serving.server import bound_socket  # imported late, since importing a server takes time

            bound_socket(self.bind).close()
        if self.file is not None:
            claim = self._claimed(self.file)
            try:
                self.check_space()
            except ConfigError:
                claim.release()
                raise

    def check_space(self) -> None:
        """Raise `ConfigError` if the disk is almost full."""
        if self.file is not None and shutil.disk_usage(self.file.parent).free < RESERVE_BYTES:
            raise ConfigError(
                f"The disk of {self.file} is full: less than {RESERVE_BYTES >> 20} MB are free; "
                "free some space or choose another --save."
            )

    def show(self) -> bool:
        """Open the viewer and serve the page, still empty; returns whether this call opened them."""
        if self._shown is not None:
            return False
        self._shown = []
        if self.serve:
            folder = Path(self._serving.enter_context(tempfile.TemporaryDirectory(prefix="calib-inspect-")))
            if self.file is None:
                self._shown.append(folder / "served.rrd")
            self._serve(self.file or self._shown[0], folder)
        if self.viewer:
            self._shown += self._open_viewer()
        if self.connect is not None:
            self._shown.append(rr.GrpcSink(self.connect))
        return True

    def open(self) -> Sequence[Any]:
        """Create the file and open the viewers; returns the file's path and Rerun's sinks."""
        file = [] if self.file is None else [self._claimed(self.file).begin()]
        self.show()
        self._begun.set()
        return [*file, *(self._shown or [])]

    def wait_while_serving(self) -> None:
        """Serve until Ctrl-C or SIGTERM; returns at once if nothing is served. The recording must be complete."""
        self._ended.set()
        if self.page is not None:
            with StopRequest() as stop:
                stop.wait()

    def complete(self) -> None:
        """Remove an earlier recording of the same name, since the new one is complete."""
        if self._claim is not None:
            self.replaced = self._claim.complete()

    @property
    def earlier(self) -> Path | None:
        """Path of an earlier recording of the same name until `complete`; None without one."""
        return None if self._claim is None else self._claim.earlier

    def close(self) -> None:
        """Stop the web server and release the file; an opened viewer stays open."""
        if self._claim is not None:
            self._claim.release()
        self._ended.set()
        self._serving.close()

    def _claimed(self, file: Path) -> Claim:
        if self._claim is None:
            self._claim = (Claim.of_new if self.numbered else Claim)(file, Kind.RECORDING)
            self.file = self._claim.path
        return self._claim

    def _open_viewer(self) -> list[Any]:
        try:
            return [rr.GrpcSink(open_window())]
        except ConfigError:
            if self.file is None:
                raise
            self.viewer = False  # the display does not work, so only the file is left
            return []

    def _serve(self, file: Path, folder: Path) -> None:
        """Serve a growing file in Rerun's web viewer, whose files are put into a folder."""
        from inspector.serving.recording import (
            RECORDING,
            recording_app,
        )  # imported late, since importing a server takes time
        from inspector.serving.server import PageServer
        from inspector.serving.viewer_files import INDEX, fetch_viewer

        fetch_viewer(folder)
        app = recording_app(file, folder, self._begun, self._ended)
        server = self._serving.enter_context(PageServer(app, self.bind, pages=[folder / INDEX]))
        self.page = f"{server.address}?url={quote(server.address + RECORDING, safe='')}&hide_welcome_screen=1"


def check_viewer(url: str) -> None:
    """Check that a viewer listens at an address.

    Raises:
        ConfigError: none does, or the address is not valid.
    """
    host, port = _address(url)
    if not listening(host, port):
        raise ConfigError(f"No viewer listens at {url}; start one with `rerun`, or use --save.")


def _address(url: str) -> tuple[str, int]:
    """Host and port of a viewer's address.

    Raises:
        ConfigError: it is not a valid address.
    """
    try:
        address = urlsplit(url)
        host, port = address.hostname, address.port or 9876
    except ValueError:  # an invalid port, or a bracket too many
        host = None
    if host is None or address.scheme not in ("rerun", "rerun+http", "rerun+https"):
        raise ConfigError(
            f"--connect {url} is not a valid address; give for instance rerun+http://127.0.0.1:9876/proxy."
        )
    return host, port


def has_display() -> bool:
    """Whether a window can open."""
    if platform.system() != "Linux" or os.environ.get("WAYLAND_DISPLAY"):
        return True
    display = os.environ.get("DISPLAY", "")
    local = re.fullmatch(r":(\d+)(\.\d+)?", display)
    return bool(display) and (local is None or Path(f"/tmp/.X11-unix/X{local[1]}").exists())
