"""Where a recording is shown and kept: options that the commands which write one share."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from inspector.record.outputs import Outputs

RECORDINGS = Path("recordings")

_OPTIONS: tuple[Callable[..., Any], ...] = (
    click.option(
        "--save", type=click.Path(path_type=Path), metavar="FILE.rrd", help="Write the recording to this file."
    ),
    click.option("--headless", is_flag=True, help="Open no window."),
    click.option("--serve", is_flag=True, help="Offer the viewer as a web page, on this machine only."),
    click.option("--bind", default="127.0.0.1", show_default=True, help="Address that --serve listens on."),
    click.option("--connect", metavar="URL", help="Send to a viewer that runs: rerun+http://HOST:PORT/proxy."),
)


def viewing_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Give a command the options that `choose_outputs` takes."""
    for option in reversed(_OPTIONS):
        command = option(command)
    return command


def choose_outputs(
    name: str, save: Path | None, headless: bool, serve: bool, bind: str, connect: str | None
) -> Outputs:
    """A viewer where one can open; the file that was asked for, or one in `RECORDINGS` if nothing else shows."""
    from inspector.record.outputs import Outputs, has_display

    viewer = has_display() and not (headless or serve or connect)
    if save is None and not (viewer or serve or connect):
        save = RECORDINGS / f"{re.sub(r'[^A-Za-z0-9_.-]+', '-', name).strip('-.') or 'run'}.rrd"
    return Outputs(save, viewer, serve, connect, bind)


def saved_lines(file: Path, frames: int) -> list[str]:
    """What to say about a recording that was written."""
    from inspector.record.outputs import open_command

    size = file.stat().st_size
    return [
        f"Saved {file} ({size / 1e6:.1f} MB, {size / frames / 1e6:.2f} MB a frame).",
        f"Open it with: {open_command(file)}",
    ]
