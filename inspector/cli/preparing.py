"""From the options of a run to a session that is ready to run: weights are loaded, and the run is announced."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from calibnet.errors import ConfigError
from calibnet.methods.registry import CASCADE
from inspector.cli.output import make_console
from inspector.run.options import DEFAULT_RANGE, RunOptions

if TYPE_CHECKING:
    from rich.console import Console

    from calibnet.calibrator import Calibrator
    from calibnet.cascade.cascade import Cascade
    from inspector.record.outputs import Outputs
    from inspector.record.recording import RunDescription
    from inspector.run.session import Session

UNJUDGED = "No result will be accepted: only results of the cascade are judged."
"""Notice for every method but the cascade."""


def prepare(options: RunOptions, outputs: Outputs, verify: bool = False) -> Session:
    """Load the cascade, announce the run, and return its session."""
    from calibnet.cascade.cascade import Cascade
    from calibnet.geometry.miscalibration import stages_within
    from inspector.record.recording import RunDescription

    if options.method != CASCADE:
        if verify:
            raise click.UsageError("Only the cascade's results are judged; leave --method out.")
        return prepare_other(options, outputs)
    numbers = options.stages or options.start.stages
    if verify and options.stages is None:  # how far off the calibration is, is the question
        numbers = max(numbers, stages_within(DEFAULT_RANGE), key=len)
    cascade = Cascade.load(options.preset, numbers, options.weights, options.stages is None, options.prior)
    stages = [stage.number for stage in cascade.stages]
    console = make_console()
    announce(console, options, cascade)
    provenance = describe_provenance(options.preset, stages, options.weights)
    description = RunDescription(options.title, options.identity(stages), provenance)
    session = make_session(options, outputs, cascade, options.solves_drive, description, console)
    return replace(session, skipped=cascade.skipped, verify=verify)


def prepare_other(options: RunOptions, outputs: Outputs) -> Session:
    """Do the same with another method than the cascade.

    Raises:
        ConfigError: the method cannot do what the options ask for.
        WeightsError: its weights are missing.
    """
    from calibnet.calibrator import DriveCalibrator, drives_only
    from inspector.record.recording import RunDescription

    method = open_other(options)
    drive = options.solves_drive and isinstance(method, DriveCalibrator)
    if options.drive and not drive:
        raise ConfigError(f"{options.method} calibrates single frames only; leave --drive out.")
    if drives_only(method) and not drive:
        raise ConfigError(
            f"{options.method} needs a drive; give several frames on one mount, and leave --no-drive and --per-frame "
            "out."
        )
    console = make_console()
    console.print(f"{options.sequence.name} ({options.sequence.rig}), {options.start}, {options.method}")
    console.print(UNJUDGED)
    description = RunDescription(options.title, options.identity([]), describe_provenance("", [], None))
    return make_session(options, outputs, method, drive, description, console)


def open_other(options: RunOptions) -> Calibrator:
    """Open the method of the options, none of whose results is accepted."""
    from calibnet.geometry.miscalibration import range_of
    from calibnet.methods.registry import open_method
    from calibnet.methods.unjudged import unjudged

    start = options.start
    method = open_method(
        options.method,
        start.range if start.given is None else range_of(start.given),
        weights=options.weights,
        masks=options.masks,
        intrinsics=options.intrinsics,
    )
    return unjudged(options.method, method)


def make_session(
    options: RunOptions,
    outputs: Outputs,
    calibrator: Calibrator,
    drive: bool,
    description: RunDescription,
    console: Console,
) -> Session:
    """The session of a run, from its options."""
    from calibnet.drive.watching import FEWEST, watch_estimate
    from inspector.run.session import Session

    count = len(options.positions)
    watched = drive and options.method == CASCADE and count >= FEWEST

    return Session(
        sequence=options.sequence,
        positions=options.positions,
        cascade=calibrator,
        start=options.start,
        drive=drive,
        drive_asked=bool(options.drive),
        stop_on_bad_frame=options.on_bad_frame == "stop",
        outputs=outputs,
        description=description,
        contents=options.contents,
        console=console,
        watching=partial(watch_estimate, count=count) if watched else None,
    )


def announce(console: Console, options: RunOptions, cascade: Cascade) -> None:
    """Print what is about to run, and which stages cannot."""
    numbers = ", ".join(map(str, cascade.numbers))
    stages = f"stage {numbers}" if len(cascade.numbers) == 1 else f"stages {numbers}"
    known = f", {options.prior.words}" if options.prior else ""
    what = f"{options.sequence.name} ({options.sequence.rig}), {options.start}{known}, {stages}"
    console.print(what)
    if options.expectation:
        console.print(options.expectation)
    for note in getattr(options.sequence, "notes", ()):
        console.print(note)
    for stage in cascade.skipped:
        console.print(f"Skipped: {stage.reason}", style="yellow")
    if cascade.unjudged:
        console.print(f"No result will be accepted: {cascade.unjudged}", style="yellow")


def describe_provenance(preset: str, stages: list[int], folder: Path | None) -> dict[str, str]:
    """Versions, and the training record of every stage's weights as JSON, by the stage's number."""
    import json
    from importlib.metadata import version

    from calibnet import __version__
    from calibnet.geometry import RANGES
    from calibnet.weights import read_record, weights_path

    files = {number: weights_path(preset, RANGES[number - 1], folder) for number in stages}
    records = {number: read_record(file) for number, file in files.items() if file.is_file()}
    versions = {"torch": version("torch"), "rerun": version("rerun-sdk")}
    return {"calib_inspect": __version__, **versions, "weights": json.dumps(records)}
