"""Reading of recordings, shared by the commands that do."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from inspector.cli.output import say

if TYPE_CHECKING:
    from inspector.read.run import RecordedRun

RECORDING = click.Path(path_type=Path)
"""An ``.rrd`` file, which `open_run` checks."""


def open_run(path: Path) -> RecordedRun:
    """Read a recording; warns on stderr if it is cut off."""
    from inspector.read.run import read_run

    run = read_run(path)
    if run.warning:
        say(run.warning, err=True)
    return run
