"""Reads the keys of a terminal one by one, without waiting for Enter."""

from __future__ import annotations

import os
import re
import select
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from calibnet.errors import ConfigError

END = ""
"""Key that stands for the end of input."""
Read = Callable[[float], list[str]]
"""Returns the keys pressed since the last call, after waiting at most the given seconds for the first."""


@contextmanager
def keyboard(descriptor: int | None = None) -> Iterator[Read]:
    """A context that reads keys, from a terminal or any other input, and restores the terminal at its end.

    Args:
        descriptor: file descriptor of the terminal; None for standard input.

    Raises:
        ConfigError: this system's terminals are not supported.
    """
    if sys.platform == "win32":
        raise ConfigError("--native reads its keys from a terminal of Linux or macOS; leave it out for the page.")
    import termios
    import tty

    terminal = sys.stdin.fileno() if descriptor is None else descriptor
    before = termios.tcgetattr(terminal) if os.isatty(terminal) else None
    if before is not None:
        tty.setcbreak(terminal)  # Ctrl-C still interrupts

    def read(seconds: float) -> list[str]:
        if not select.select([terminal], [], [], seconds)[0]:
            return []
        text = os.read(terminal, 1024).decode(errors="ignore")
        return split_keys(text) if text else [END]

    try:
        yield read
    finally:
        if before is not None:
            termios.tcsetattr(terminal, termios.TCSADRAIN, before)


_KEY = re.compile(r"\x1b\[\[.|\x1b\[[0-?]*[ -/]*[@-~]|\x1bO.|\x1b[^\x1b]|.", re.DOTALL)
"""F1 of Linux's console; a control sequence of ECMA-48, such as ``ESC [ C`` for the right arrow and ``ESC [ 15 ~`` for
F5; a key of the keypad; a key with Alt; any other character."""


def split_keys(text: str) -> list[str]:
    """Split what a terminal sends into one text per key."""
    return _KEY.findall(text)
