"""``calib-inspect seq|raw|object|tracking|kitti360|nuscenes|folder|bag|demo``: calibrate, and record every stage."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from inspector.cli.run import calibrate
from inspector.cli.run_options import run_options
from inspector.cli.subcommands import Opening, over_sequences

if TYPE_CHECKING:
    from inspector.cli.viewing import Viewing

DEMO_LENGTH = 12

length_option = click.option(
    "--length", type=click.IntRange(min=1), default=DEMO_LENGTH, show_default=True, help="Number of frames."
)


@click.group()
def runs() -> None:
    """Calibrate frames and record every stage; `calib-inspect` offers these subcommands as commands of its own."""


def calibrate_opened(opening: Opening, **asked: Any) -> int:
    """Open a sequence and calibrate it; returns the exit code."""
    return calibrate(opening(), **asked)


over_sequences(runs, calibrate_opened, lambda source: run_options(source.given), "Calibrate")


@runs.command()
@length_option
@run_options()
def demo(length: int, viewing: Viewing, report: Path | None, **asked: Any) -> int:
    """Calibrate a drive through the synthetic world, without any data.

    The recording is saved as recordings/demo.rrd or, if that exists, as demo-2.rrd and so on.
    """
    from calibnet.datasets.synthetic import KITTI_LIKE, SyntheticSequence

    if report is None:
        viewing = replace(viewing, keep="demo")
    drive = SyntheticSequence(seed=asked["seed"], length=length, rig=KITTI_LIKE)
    return calibrate(drive, viewing=viewing, report=report, **asked)
