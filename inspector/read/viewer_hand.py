"""Presses buttons of Rerun's viewer by their labels, for what no command of the viewer does.

Uses ``rerun viewer-mcp``, which speaks JSON-RPC, one message per line (the Model Context Protocol).
"""

from __future__ import annotations

import json
import subprocess
import threading
import time
from typing import Any, Final

from calibnet.errors import ConfigError
from calibnet.runtime.text import one_line
from inspector.programs import end_with_parent, rerun_binary

PATIENCE_S: Final = 120.0
PROTOCOL: Final = "2025-06-18"
OUTSIDE: Final = {"x": -50.0, "y": -50.0}
"""Position of the pointer afterwards; elsewhere, pictures would show it and what it hovers over."""


def press(endpoint: str, button: str) -> None:
    """Press a button of a viewer as soon as it appears.

    Args:
        endpoint: address of the viewer, for instance ``http://127.0.0.1:9876``.
        button: label of the button.

    Raises:
        ConfigError: there is no such button, or the viewer does not answer.
    """
    named, last = {"label_contains": button}, ""
    acts = [
        {"name": "wait_for", "args": {**named, "timeout_secs": 10}},
        {"name": "click", "args": named},
        {"name": "hover", "args": {"pos": OUTSIDE}},
    ]
    deadline = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline:  # a busy machine answers late, and Rerun's own time limit is shorter than ours
        done = _call(endpoint, "batch", {"actions": acts})
        if not done.get("isError", True):
            return
        last = one_line(str(done))[:300]
    raise ConfigError(
        f"The viewer's button {button!r} could not be pressed ({last or 'no answer'}); try again on a less busy "
        "machine."
    )


def _call(endpoint: str, tool: str, arguments: dict[str, Any]) -> dict[str, Any]:
    """The result of a tool of the server; empty where the server does not answer in time."""
    hello = {"protocolVersion": PROTOCOL, "capabilities": {}, "clientInfo": {"name": "calib-inspect", "version": "1"}}
    messages: list[dict[str, Any]] = [
        {"id": 1, "method": "initialize", "params": hello},
        {"method": "notifications/initialized", "params": {}},
        {"id": 2, "method": "tools/call", "params": {"name": tool, "arguments": arguments}},
    ]
    server = subprocess.Popen(
        [rerun_binary(), "viewer-mcp", "--endpoint", endpoint],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        preexec_fn=end_with_parent(),
    )
    impatience = threading.Timer(PATIENCE_S, server.kill)
    impatience.start()
    try:
        assert server.stdin is not None
        assert server.stdout is not None
        server.stdin.writelines(json.dumps({"jsonrpc": "2.0", **message}) + "\n" for message in messages)
        server.stdin.flush()
        for line in server.stdout:
            answer = json.loads(line)
            if answer.get("id") == 2:
                result: dict[str, Any] = answer.get("result", {})
                return result
        return {}
    finally:
        impatience.cancel()
        server.kill()
        server.communicate()
