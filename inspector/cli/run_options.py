"""The options of a calibration run, which all commands have that calibrate something."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import click

from inspector.cli.options import (
    COLORING,
    DETAIL,
    FOLDER,
    FRAMES,
    KNOWN_OPTIONS,
    METHOD_OPTIONS,
    MISCALIBRATION,
    PARTS,
    RANGE,
    SEED,
    STAGES,
)
from inspector.cli.viewing import viewing_options
from inspector.run.options import DEFAULT_RANGE

_OPTIONS: tuple[Callable[..., Any], ...] = (
    click.option(
        "--frames",
        type=FRAMES,
        help="Positions to run, for instance 0:100:5, or : for all.  [default: all; of more than 200, 200 of them]",
    ),
    click.option(
        "--range",
        type=RANGE,
        help=f"Draw the miscalibration from ± these degrees and metres.  [default: {DEFAULT_RANGE}]",
    ),
    click.option(
        "--miscalibrate", "miscalibration", type=MISCALIBRATION, help="This miscalibration, instead of drawing one."
    ),
    click.option("--per-frame", is_flag=True, help="Draw one for every frame, not one for the run."),
    click.option("--seed", type=SEED, default=0, show_default=True, help="Seed of everything random."),
    click.option(
        "--drive/--no-drive",
        default=None,
        help="After the frames, solve the one extrinsic of the whole drive from all of them: the best there is.  "
        "[default: with several frames on one mount]",
    ),
    click.option("--sequence-estimate/--no-sequence-estimate", "drive", default=None, hidden=True),  # its former name
    click.option(
        "--on-bad-frame",
        type=click.Choice(["skip", "stop"]),
        default="skip",
        show_default=True,
        help="What to do at a frame that cannot be read or calibrated; half of them or more end the run anyway.",
    ),
    *KNOWN_OPTIONS,
    click.option("--stages", type=STAGES, help="Stages to run, for instance 3-5.  [default: those within the range]"),
    click.option("--preset", default="compact", show_default=True, help="Network to use."),
    *METHOD_OPTIONS,
    click.option("--weights", type=FOLDER, help="Folder of its weights.  [default: those of the package]"),
    click.option(
        "--detail",
        type=DETAIL,
        help="full: some 6 MB a frame; overview: fewer points, the finest scale and no raw volumes, 1 MB at most; "
        "custom: what --log names.  [default: full, from 200 frames on overview]",
    ),
    click.option(
        "--log",
        "parts",
        type=PARTS,
        help="With --detail custom, parts of a frame to record: curves (errors), overlays (after every stage), volumes "
        "(maps of the cost volumes), hourglass (activations), scene (3D), tensors (raw volumes, all slices). Image, "
        "first and last overlay, extrinsics and table are always there.",
    ),
    click.option(
        "--color",
        type=COLORING,
        default="depth",
        show_default=True,
        help="Colour of the points on the image; edge: depth edges stand out; error: pixels off the reference.",
    ),
    click.option(
        "--report", type=FOLDER, metavar="DIR", help="Make a report of the run there, as `calib-inspect report` does."
    ),
)


def run_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Give a command all options of a calibration run; it passes them on to `calibrate`, under the same names."""
    command = viewing_options(command)
    for option in reversed(_OPTIONS):
        command = option(command)
    return command
