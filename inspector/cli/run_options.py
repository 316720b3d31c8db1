"""Options of a calibration run, shared by all commands that calibrate."""

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
from inspector.cli.output import JSON_FILE
from inspector.cli.viewing import viewing_options, windowless_options
from inspector.run.options import DEFAULT_RANGE, MANY_FRAMES

Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]


def start_options(given: bool, every: str) -> tuple[Decorator, ...]:
    """Options for the frames to run and the extrinsics to start from.

    Args:
        given: whether a run without a miscalibration starts from the dataset's extrinsic as it is.
        every: the default frames, in words.
    """
    undisturbed = "none, start from the calibration as it is" if given else str(DEFAULT_RANGE)
    return (
        click.option(
            "--frames",
            type=FRAMES,
            help=f"Positions to run, for instance 0:100:5, or : for all.  [default: {every}]",
        ),
        click.option(
            "--range",
            type=RANGE,
            help=f"Draw a random miscalibration within ± these degrees and metres.  [default: {undisturbed}]",
        ),
        click.option(
            "--miscalibrate",
            "miscalibration",
            type=MISCALIBRATION,
            help="Use this miscalibration instead of a random one.",
        ),
        click.option("--seed", type=SEED, default=0, show_default=True, help="Seed of all random numbers."),
        *KNOWN_OPTIONS,
    )


NETWORK_OPTIONS: tuple[Decorator, ...] = (
    click.option("--stages", type=STAGES, help="Stages to run, for instance 3-5.  [default: those within the range]"),
    click.option("--preset", default="compact", show_default=True, help="Network to use."),
    click.option("--weights", type=FOLDER, help="Folder with the network's weights.  [default: those of the package]"),
)
"""Options for the networks to run."""
BAD_FRAME_OPTION: Decorator = click.option(
    "--on-bad-frame",
    type=click.Choice(["skip", "stop"]),
    default="skip",
    show_default=True,
    help="What to do with a frame that cannot be read or calibrated. A run always stops if half of its frames fail.",
)
RECORDING_OPTIONS: tuple[Decorator, ...] = (
    click.option(
        "--detail",
        type=DETAIL,
        help="full: about 6 MB per frame; overview: fewer points, only the finest scale and no raw volumes, at most 1 "
        "MB; custom: what --log names.  [default: full, from 200 frames on overview]",
    ),
    click.option(
        "--log",
        "parts",
        type=PARTS,
        help="With --detail custom, parts of a frame to record: curves (errors), overlays (after every stage), volumes "
        "(maps of the cost volumes), hourglass (activations), scene (3D), tensors (raw volumes, all slices). Image, "
        "first and last overlay, extrinsics and table are always recorded.",
    ),
    click.option(
        "--color",
        type=COLORING,
        default="depth",
        show_default=True,
        help="Colour of the points on the image: edge highlights depth edges, error shows the distance from the "
        "reference in pixels.",
    ),
    click.option(
        "--report",
        type=FOLDER,
        metavar="DIR",
        help="Write a report of the run to this folder, as `calib-inspect report` does.",
    ),
)
"""Options for what is recorded of each frame, and for the report."""
PER_FRAME_OPTION: Decorator = click.option(
    "--per-frame", is_flag=True, help="Draw a new miscalibration for every frame instead of one for the run."
)
DRIVE_OPTION: Decorator = click.option(
    "--drive/--no-drive",
    default=None,
    help="After the single frames, solve one extrinsic from all of them, which is the most accurate.  "
    "[default: with several frames on one mount]",
)
JSON_OPTION: Decorator = click.option(
    "--json", "json_file", type=JSON_FILE, metavar="FILE|-", help="The result as JSON; - for stdout."
)
FEW = f"all; of more than {MANY_FRAMES}, {MANY_FRAMES} of them"


def run_options(given: bool = False) -> Decorator:
    """Give a command all options of a calibration run, which it passes on to `calibrate` under the same names.

    Args:
        given: see `start_options`.
    """
    return _all(
        *start_options(given, FEW),
        PER_FRAME_OPTION,
        DRIVE_OPTION,
        BAD_FRAME_OPTION,
        *NETWORK_OPTIONS,
        *METHOD_OPTIONS,
        *RECORDING_OPTIONS,
        viewing_options,
    )


def verify_options() -> Decorator:
    """Give a command the options that `verify` has for all kinds of data."""
    return _all(
        *start_options(True, FEW),
        BAD_FRAME_OPTION,
        *NETWORK_OPTIONS,
        *RECORDING_OPTIONS,
        JSON_OPTION,
        windowless_options,
    )


def watch_options() -> Decorator:
    """Give a command the options that `watch` has for all kinds of data."""
    return _all(*start_options(True, "all"), *NETWORK_OPTIONS, JSON_OPTION, windowless_options)


def _all(*options: Decorator) -> Decorator:
    """One decorator for several options, which appear in this order."""

    def decorate(command: Callable[..., Any]) -> Callable[..., Any]:
        for option in reversed(options):
            command = option(command)
        return command

    return decorate
