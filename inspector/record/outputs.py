"""Where a recording goes: a file, a viewer on this machine, a web viewer, or one that runs elsewhere."""

from __future__ import annotations

import importlib.util
import os
import platform
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import quote, urlsplit

import rerun as rr

from calibnet.errors import ConfigError
from calibnet.runtime.claim import Claim
from calibnet.runtime.interruption import StopRequest
from calibnet.runtime.writing import Kind

LOCALHOST = "127.0.0.1"
START_TIMEOUT_S = 30.0
SETTLE_S = 1.5
SWITCHED_OFF = ("0", "off", "false", "no")
"""Values of the variable RERUN with which Rerun records nothing, without a word."""
PR_SET_PDEATHSIG = 1
"""Of Linux's prctl: the signal that a process gets when its parent ends."""
RESERVE_BYTES = 32 * 1024 * 1024
"""Free disk space below which recording stops, while what is at hand can still be written."""


@dataclass
class Outputs:
    """The sinks of one recording, and the processes they need.

    Attributes:
        file: ``.rrd`` to write; an earlier one is put aside when the first frame is there, and removed by `complete`.
        viewer: open the viewer in a window.
        serve: offer the web viewer.
        connect: gRPC address of a viewer that runs already.
        bind: address that servers started here listen on.
        numbered: ``file`` is a name of ours, which gets a number where a file has it already.
        replaced: `complete` has removed an earlier recording.
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
    _server: subprocess.Popen[bytes] | None = field(default=None, init=False, repr=False)

    def check(self) -> None:
        """Find out before the work whether the outputs can be opened, and claim the file until `close`.

        Raises:
            ConfigError: the file may not or cannot be written, or nothing listens at ``connect``.
        """
        if os.environ.get("RERUN", "").lower() in SWITCHED_OFF:
            raise ConfigError("RERUN in the environment switches Rerun off, so nothing would be recorded; unset it.")
        if self.connect is not None:
            check_viewer(self.connect)
        if self.file is not None:
            claim = self._claimed(self.file)
            try:
                self.check_space()
            except ConfigError:
                claim.release()
                raise

    def check_space(self) -> None:
        """Raise `ConfigError` when the disk is about to be full."""
        if self.file is not None and shutil.disk_usage(self.file.parent).free < RESERVE_BYTES:
            raise ConfigError(
                f"The disk of {self.file} is full: less than {RESERVE_BYTES >> 20} MB are free; "
                "free some space or choose another --save."
            )

    def open(self) -> Sequence[Any]:
        """Create the file, start what has to be started, and return the file's path and Rerun's sinks."""
        sinks: list[Any] = []
        if self.file is not None:
            sinks.append(self._claimed(self.file).begin())
        if self.viewer:
            sinks += self._open_viewer()
        if self.serve:
            sinks.append(rr.GrpcSink(self._serve()))
        if self.connect is not None:
            sinks.append(rr.GrpcSink(self.connect))
        return sinks

    def wait_while_serving(self) -> None:
        """Return at Ctrl-C, SIGTERM or the web server's end; at once when there is none."""
        with StopRequest() as stop:
            while self._server is not None and self._server.poll() is None and not stop.requested:
                time.sleep(0.1)

    def complete(self) -> None:
        """The recording is closed and whole: an earlier one of its name is removed."""
        if self._claim is not None:
            self.replaced = self._claim.complete()

    @property
    def earlier(self) -> Path | None:
        """Where an earlier recording of the same name lies, until `complete`."""
        return None if self._claim is None else self._claim.earlier

    def close(self) -> None:
        """Stop the web server and let others write the file; an opened viewer stays."""
        if self._claim is not None:
            self._claim.release()
        if self._server is not None:
            self._server.terminate()
            self._server.wait()

    def _claimed(self, file: Path) -> Claim:
        if self._claim is None:
            self._claim = (Claim.of_new if self.numbered else Claim)(file, Kind.RECORDING)
            self.file = self._claim.path
        return self._claim

    def _open_viewer(self) -> list[Any]:
        try:
            return [rr.GrpcSink(open_viewer(self.bind))]
        except ConfigError:
            if self.file is None:
                raise
            self.viewer = False  # a screen was promised and is not there: the file is what remains
            return []

    def _serve(self) -> str:
        port, web_port = free_port(), free_port()
        ports = ["--port", str(port), "--web-viewer-port", str(web_port)]
        self._server = start_program([rerun_binary(), "--serve-web", "--bind", self.bind, *ports], port)
        host = LOCALHOST if self.bind in ("0.0.0.0", LOCALHOST) else self.bind
        url = f"rerun+http://{host}:{port}/proxy"
        self.page = f"http://{host}:{web_port}/?url={quote(url, safe='')}"
        return url


def open_viewer(bind: str = LOCALHOST) -> str:
    """Open a viewer in a window, which outlives this process, and return its address.

    Raises:
        ConfigError: it does not start.
    """
    port = free_port()
    command = [rerun_binary(), "--port", str(port), "--bind", bind, "--hide-welcome-screen"]
    start_program(command, port, outlives_us=True)
    return f"rerun+http://{LOCALHOST}:{port}/proxy"


def check_viewer(url: str) -> None:
    """Find out whether a viewer listens at an address.

    Raises:
        ConfigError: none does, or it is no address.
    """
    host, port = _address(url)
    if not _listening(host, port):
        raise ConfigError(f"No viewer listens at {url}; start one with `rerun`, or use --save.")


def _address(url: str) -> tuple[str, int]:
    """Host and port of a viewer's address.

    Raises:
        ConfigError: it is none.
    """
    try:
        address = urlsplit(url)
        host, port = address.hostname, address.port or 9876
    except ValueError:  # a port that is none, a bracket too many
        host = None
    if host is None or address.scheme not in ("rerun", "rerun+http", "rerun+https"):
        raise ConfigError(f"--connect {url} is no address such as rerun+http://127.0.0.1:9876/proxy.")
    return host, port


def has_display() -> bool:
    """Whether a window could open."""
    if platform.system() != "Linux" or os.environ.get("WAYLAND_DISPLAY"):
        return True
    display = os.environ.get("DISPLAY", "")
    local = re.fullmatch(r":(\d+)(\.\d+)?", display)
    return bool(display) and (local is None or Path(f"/tmp/.X11-unix/X{local[1]}").exists())


def rerun_binary() -> str:
    """The viewer's own binary: the `rerun` on PATH is a script that would outlive its signals."""
    package = importlib.util.find_spec("rerun_cli")
    binary = Path(package.origin if package and package.origin else "").with_name(
        "rerun.exe" if os.name == "nt" else "rerun"
    )
    if not binary.is_file():
        raise ConfigError("The Rerun viewer is not installed; reinstall rerun-sdk, or use --save and --headless.")
    return str(binary)


def open_command(file: Path) -> str:
    """What to type to look at a recording."""
    program = "rerun"
    if shutil.which(program) is None:
        beside = Path(sys.executable).with_name(program)
        program = os.path.relpath(beside) if Path.cwd() in beside.parents else str(beside)
    return f"{program} {file}"


def start_program(command: list[str], port: int, outlives_us: bool = False) -> subprocess.Popen[bytes]:
    """Start a program in its own session, so that Ctrl-C reaches only this one; wait for its port.

    Args:
        command: the program.
        port: that it opens.
        outlives_us: it goes on when this process ends, as a window does; else Linux ends it even if this one is killed.
    """
    process = subprocess.Popen(
        command,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
        preexec_fn=None if outlives_us else end_with_parent(),
    )
    deadline = time.monotonic() + START_TIMEOUT_S
    listening_since = None
    # A viewer that finds no screen or graphics driver opens its port first and ends a moment later.
    while listening_since is None or time.monotonic() < listening_since + SETTLE_S:
        if process.poll() is not None or time.monotonic() > deadline:
            process.kill()
            raise ConfigError("The Rerun viewer did not start; use --headless and look at the file later.")
        if listening_since is None and _listening(LOCALHOST, port):
            listening_since = time.monotonic()
        time.sleep(0.05)
    return process


def end_with_parent() -> Callable[[], None] | None:
    """What a child does before it becomes its program, so that it ends when we do; nothing where only Linux can."""
    if sys.platform != "linux":
        return None
    import ctypes

    libc, parent = ctypes.CDLL(None), os.getpid()

    def bind() -> None:
        libc.prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
        if os.getppid() != parent:  # it ended before the call
            os._exit(1)

    return bind


def _listening(host: str, port: int) -> bool:
    try:
        with socket.create_connection((host, port), timeout=2.0):
            return True
    except OSError:
        return False


def free_port() -> int:
    """A port of this machine that nothing listens on."""
    with socket.socket() as probe:
        probe.bind((LOCALHOST, 0))
        return int(probe.getsockname()[1])
