"""A calibration run from its options to its end: what `seq`, `raw`, `object`, `folder` and `demo` share."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from calibnet.errors import ConfigError
from calibnet.methods.registry import CASCADE
from inspector.cli.errors import ExitCode, fail
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
from inspector.cli.output import make_console, say
from inspector.cli.viewing import next_lines, saved_lines, viewing_options
from inspector.run.options import DEFAULT_RANGE, OptionsError, RunOptions

if TYPE_CHECKING:
    from rich.console import Console

    from calibnet.cascade.cascade import Cascade
    from calibnet.datasets import Sequence
    from calibnet.methods.calibrator import Calibrator
    from inspector.cli.viewing import Viewing
    from inspector.record.outputs import Outputs
    from inspector.record.recording import RunDescription
    from inspector.run.session import Session
    from inspector.run.summary import Summary

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
    click.option("--seed", type=SEED, default=0, show_default=True, help="Of everything random."),
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
        help="Of the points over the image; edge: those at depth edges stand out; error: pixels off the reference.",
    ),
    click.option(
        "--report", type=FOLDER, metavar="DIR", help="Make a report of the run there, as `calib-inspect report` does."
    ),
)


UNJUDGED = "No result will be accepted: what it finds is not judged, which only the cascade's is."
"""Of every method but the cascade."""


def run_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Give a command all options of a calibration run; it passes them on to `calibrate`, under the same names."""
    command = viewing_options(command)
    for option in reversed(_OPTIONS):
        command = option(command)
    return command


def calibrate(sequence: Sequence, *, viewing: Viewing, report: Path | None, **asked: Any) -> int:
    """Run the cascade on a sequence; returns the exit code.

    Args:
        sequence: what to calibrate.
        viewing: where the recording is shown and kept.
        report: folder of the report to make.
        **asked: fields of `RunOptions`.
    """
    options = checked(sequence, asked)
    outputs = choose_outputs(options, viewing, report)
    with recording_to(outputs):
        return finish(prepare(options, outputs).run(), outputs, report)


def checked(sequence: Sequence, asked: Mapping[str, Any]) -> RunOptions:
    """The options of a run, which do not contradict each other and select some frames."""
    try:
        options = RunOptions(sequence=sequence, **asked)
    except OptionsError as error:
        raise click.UsageError(str(error)) from None
    options.positions  # noqa: B018
    return options


def prepare(options: RunOptions, outputs: Outputs, verify: bool = False) -> Session:
    """Load the cascade, say what is about to run, and hand back the run."""
    from calibnet.cascade.cascade import Cascade
    from calibnet.geometry.miscalibration import stages_within
    from inspector.record.recording import RunDescription

    if options.method != CASCADE:
        if verify:
            raise click.UsageError("Only the cascade's results are judged; leave --method out.")
        return prepare_other(options, outputs)
    numbers = options.stages or options.start.stages
    if verify and options.stages is None:  # how far off the calibration is, is what is asked
        numbers = max(numbers, stages_within(DEFAULT_RANGE), key=len)
    cascade = Cascade.load(options.preset, numbers, options.weights, options.stages is None, options.known)
    stages = [stage.number for stage in cascade.stages]
    console = make_console()
    announce(console, options, cascade)
    provenance = describe_provenance(options.preset, stages, options.weights)
    description = RunDescription(options.title, options.identity(stages), provenance)
    session = make_session(options, outputs, cascade, options.solves_drive, description, console)
    return replace(session, skipped=cascade.skipped, verify=verify)


def prepare_other(options: RunOptions, outputs: Outputs) -> Session:
    """The same with another method than the cascade.

    Raises:
        ConfigError: the method is asked for what it cannot do.
        WeightsError: its weights are missing.
    """
    from calibnet.methods.calibrator import DriveCalibrator, drives_only
    from inspector.record.recording import RunDescription

    method = open_other(options)
    drive = options.solves_drive and isinstance(method, DriveCalibrator)
    if options.drive and not drive:
        raise ConfigError(f"{options.method} calibrates single frames and solves no drive; leave --drive out.")
    if drives_only(method) and not drive:
        raise ConfigError(
            f"{options.method} needs a drive: several frames on one mount, and neither --no-drive nor --per-frame."
        )
    console = make_console()
    console.print(f"{options.sequence.name} ({options.sequence.rig}), {options.start}, {options.method}", markup=False)
    console.print(UNJUDGED, markup=False, soft_wrap=True)
    description = RunDescription(options.title, options.identity([]), describe_provenance("", [], None))
    return make_session(options, outputs, method, drive, description, console)


def open_other(options: RunOptions) -> Calibrator:
    """The method that is asked for, with nothing of it accepted."""
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
    """A run as its options say."""
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


@contextmanager
def recording_to(outputs: Outputs) -> Iterator[None]:
    """Close the outputs in the end, whatever happens."""
    from inspector.record.flushing import RecordingLostError

    try:
        yield
    except RecordingLostError as error:
        outputs.close()
        os._exit(fail(str(error)))  # Rerun would wait for its dead writer for ever at the interpreter's end
    finally:
        outputs.close()


def choose_outputs(options: RunOptions, viewing: Viewing, report: Path | None) -> Outputs:
    """Where the recording goes, found out to work; a report keeps it, if nothing else does."""
    if report is not None:
        from inspector.report.write import RECORDING, check_folder

        check_folder(report)
        viewing = replace(viewing, save=viewing.save or report / RECORDING)
    outputs = viewing.outputs(options.sequence.name)
    outputs.check()
    return outputs


def announce(console: Console, options: RunOptions, cascade: Cascade) -> None:
    """Say what is about to run, and which stages cannot."""
    numbers = ", ".join(str(stage.number) for stage in cascade.stages)
    known = f", {options.known.words}" if options.known else ""
    what = f"{options.sequence.name} ({options.sequence.rig}), {options.start}{known}, stages {numbers}"
    console.print(what, markup=False, soft_wrap=True)
    if options.expectation:
        console.print(options.expectation, markup=False, soft_wrap=True)
    for note in getattr(options.sequence, "notes", ()):
        console.print(note, markup=False, soft_wrap=True)
    for stage in cascade.skipped:
        console.print(f"Skipped: {stage.reason}", style="yellow", markup=False, soft_wrap=True)
    if cascade.unjudged:
        console.print(f"No result will be accepted: {cascade.unjudged}", style="yellow", markup=False, soft_wrap=True)


def describe_provenance(preset: str, stages: list[int], folder: Path | None) -> dict[str, str]:
    """Versions, and as JSON the training record of every stage's weights by its number."""
    import json
    from importlib.metadata import version

    from calibnet import __version__
    from calibnet.geometry import RANGES
    from calibnet.weights import read_record, weights_path

    files = {number: weights_path(preset, RANGES[number - 1], folder) for number in stages}
    records = {number: read_record(file) for number, file in files.items() if file.is_file()}
    versions = {"torch": version("torch"), "rerun": version("rerun-sdk")}
    return {"calib_inspect": __version__, **versions, "weights": json.dumps(records)}


def finish(summary: Summary, outputs: Outputs, report: Path | None, on_stderr: bool = False) -> int:
    """Print the result and where it is, make the report, and serve until Ctrl-C where that was asked for.

    The last line is the verdict. With ``on_stderr``, stdout is for something else.
    """
    tell = partial(say, err=on_stderr)
    for line in summary.lines():
        tell(line)
    if outputs.file is not None and summary.frames:
        tell(size_line(outputs.file, summary.frames))
        for line in [*saved_lines(outputs, summary.frames), *next_lines(outputs.file)]:
            tell(line)
        if report is not None:
            from inspector.cli.report import write_report_of

            write_report_of(outputs.file, report, on_stderr)
    for line in summary.matrix_lines():
        tell(line)
    if outputs.page is not None and not summary.interrupted:
        tell(f"Serving at {outputs.page} until Ctrl-C.")
    if summary.verdict:
        tell(summary.verdict)
    if summary.interrupted:
        say("Interrupted: the frames above are all that was recorded.", err=True)
        return ExitCode.INTERRUPTED
    if outputs.page is not None:
        outputs.wait_while_serving()
    return ExitCode.OK


def size_line(file: Path, frames: int) -> str:
    """What a frame's bytes go to."""
    from inspector.read.sizes import sizes_by_group

    parts = [f"{group} {size / frames / 1e3:.0f}" for group, size in sizes_by_group(file).items()]
    return f"Kilobytes a frame: {', '.join(parts)}."
