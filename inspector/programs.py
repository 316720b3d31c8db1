"""Starts other programs (Rerun's binary, viewer and servers), and finds the ports that they listen on."""

from __future__ import annotations

import importlib.util
import os
import secrets
import shlex
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from ipaddress import ip_address
from pathlib import Path

from calibnet.errors import ConfigError

LOCALHOST = "127.0.0.1"
SWITCHED_OFF = ("0", "off", "false", "no")
"""Values of the variable RERUN with which Rerun silently records nothing."""
START_TIMEOUT_S = 30.0
SETTLE_S = 1.5
PR_SET_PDEATHSIG = 1
"""Option of Linux's prctl: the signal that a process gets when its parent ends."""


def rerun_binary() -> str:
    """Path of the viewer's own binary; the `rerun` on PATH is a script that does not pass signals on."""
    package = importlib.util.find_spec("rerun_cli")
    binary = Path(package.origin if package and package.origin else "").with_name(
        "rerun.exe" if os.name == "nt" else "rerun"
    )
    if not binary.is_file():
        raise ConfigError("The Rerun viewer is not installed; reinstall rerun-sdk, or use --save and --headless.")
    return str(binary)


def open_command(file: Path) -> str:
    """The command that opens a recording."""
    program = "rerun"
    if shutil.which(program) is None:
        beside = Path(sys.executable).with_name(program)
        program = os.path.relpath(beside) if Path.cwd() in beside.parents else str(beside)
    return shlex.join([program, str(file)])


def own_address() -> str:
    """An address for Rerun's servers that only this machine reaches and that no web page can guess.

    Rerun's servers answer requests that name any host, so a web page whose name resolves to 127.0.0.1 could read what
    they show. On Linux all of 127.0.0.0/8 is this machine, so the address is one of 16 million; other systems have only
    one.
    """
    if sys.platform != "linux":
        return LOCALHOST
    return str(ip_address("127.0.0.2") + secrets.randbelow((1 << 24) - 3))


def open_window(*shown: str) -> str:
    """Open Rerun's viewer in a window that outlives this process; returns the address to send it data.

    Args:
        shown: files or addresses that it opens.

    Raises:
        ConfigError: it does not start.
    """
    host, port = own_address(), free_port()
    command = [rerun_binary(), *shown, "--port", str(port), "--bind", host, "--hide-welcome-screen"]
    start_program(command, port, host, outlives_us=True)
    return f"rerun+http://{host}:{port}/proxy"


def start_program(
    command: list[str], port: int, host: str = LOCALHOST, outlives_us: bool = False
) -> subprocess.Popen[bytes]:
    """Start a program in its own session, so that Ctrl-C reaches only this one; wait for its port.

    Args:
        command: the program.
        port: port that it opens.
        host: address on which it opens the port.
        outlives_us: whether it goes on when this process ends, as a window does; otherwise Linux ends it even if this
            process is killed.
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
    # A viewer that finds no display or graphics driver opens its port first and exits a moment later.
    while listening_since is None or time.monotonic() < listening_since + SETTLE_S:
        if process.poll() is not None or time.monotonic() > deadline:
            process.kill()
            raise ConfigError("The Rerun viewer did not start; use --headless, and open the file later.")
        if listening_since is None and listening(host, port):
            listening_since = time.monotonic()
        time.sleep(0.05)
    return process


def end_with_parent() -> Callable[[], None] | None:
    """A function for a child process to run before its program, so that it ends with this process; None off Linux."""
    if sys.platform != "linux":
        return None
    import ctypes

    libc, parent = ctypes.CDLL(None), os.getpid()

    def bind() -> None:
        libc.prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
        if os.getppid() != parent:  # the parent ended before the call
            os._exit(1)

    return bind


def listening(host: str, port: int) -> bool:
    """Whether a port can be connected to."""
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
