"""``calib-inspect verify seq|raw|object|folder``: whether the calibration that you have is good."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from calibnet.errors import CalibnetError
from inspector.cli.errors import VERDICT_CODES, ExitCode
from inspector.cli.inspect import (
    FOLDER_ONLY,
    camera_option,
    disturbed,
    folder_options,
    open_folder,
    open_object,
    open_odometry,
    open_raw,
    root_option,
    split_option,
)
from inspector.cli.options import FOLDER
from inspector.cli.output import JSON_FILE, prepare_json, say, write_json
from inspector.cli.run import checked, choose_outputs, finish, prepare, recording_to, run_options

if TYPE_CHECKING:
    from calibnet.datasets import Sequence
    from calibnet.verdict import Verdict
    from inspector.cli.viewing import Viewing
    from inspector.run.options import RunOptions


@click.group()
def verify() -> None:
    """Say whether the calibration that you have is good.

    It starts from the calibration as it is (or disturbed by --miscalibrate or --range, to try this command), solves the
    drive where there are several frames, and holds what it finds against it. A drive tolerates 0.5° and 15 cm, a single
    frame 1.5° and 40 cm.

    One sentence; exits with 0 for accepted, 1 for rejected, 4 for cannot tell. Input that can be read but does not fit
    is a verdict as well. Nothing is recorded or shown without --save, --report, --serve or --connect, and nothing is
    ever exported.
    """


def verify_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Give a command all options of a calibration run, and ``--json``."""
    json_option = click.option(
        "--json", "json_file", type=JSON_FILE, metavar="FILE|-", help="The verdict as JSON; - for stdout."
    )
    return json_option(run_options(command))


@verify.command()
@click.argument("sequence")
@root_option
@camera_option
@verify_options
def seq(sequence: str, root: Path | None, camera: int, **asked: Any) -> int:
    """Of a KITTI odometry sequence, for instance 04."""
    return verify_sequence(lambda: open_odometry(sequence, root, camera), camera=camera, **asked)


@verify.command()
@click.argument("date")
@click.argument("number", metavar="DRIVE")
@root_option
@camera_option
@verify_options
def raw(date: str, number: str, root: Path | None, camera: int, **asked: Any) -> int:
    """Of a KITTI raw drive, for instance 2011_09_26 0005."""
    return verify_sequence(lambda: open_raw(date, number, root, camera), camera=camera, **asked)


@verify.command("object")
@split_option
@root_option
@camera_option
@verify_options
def object_(split: str, root: Path | None, camera: int, **asked: Any) -> int:
    """Of the KITTI object detection frames, which are of one calibration only where they are of one day."""
    return verify_sequence(lambda: open_object(split, root, camera), camera=camera, **asked)


@verify.command()
@click.argument("directory", type=FOLDER)
@folder_options
@verify_options
def folder(directory: Path, dataset: str, **asked: Any) -> int:
    """Of a folder with images/, clouds/ and calibration.yaml."""
    of_folder = {**asked}
    for name in FOLDER_ONLY:
        del asked[name]
    return verify_sequence(lambda: open_folder(directory, dataset, of_folder), **asked)


def verify_sequence(
    opening: Callable[[], Sequence], *, json_file: str | None, viewing: Viewing, report: Path | None, **asked: Any
) -> int:
    """Judge the calibration of a sequence; returns the exit code.

    Args:
        opening: opens the sequence.
        json_file: where the verdict goes as JSON.
        viewing: where the recording is shown and kept, if anywhere.
        report: folder of the report to make.
        **asked: fields of `RunOptions`.
    """
    if asked["per_frame"]:
        raise click.UsageError("verify judges one calibration; --per-frame draws another for every frame.")
    prepare_json(json_file)
    from calibnet.judging.verify import named_cause, unfit
    from inspector.run.verification import UNKNOWN

    try:
        sequence = opening()
    except CalibnetError as error:
        causes = named_cause(error)
        if not causes:
            raise
        return conclude(unfit(UNKNOWN, str(error), causes), json_file)
    options = checked(sequence, {**asked, "as_is": not disturbed(asked)})
    options = replace(options, drive=options.drive or len(options.positions) > 1)
    return verify_run(options, json_file, viewing, report)


def verify_run(options: RunOptions, json_file: str | None, viewing: Viewing, report: Path | None) -> int:
    """Run what the verdict needs, record it where that was asked for, and say the verdict."""
    from inspector.record.outputs import Outputs
    from inspector.run.verification import verify_session

    record = bool(viewing.save or report or viewing.serve or viewing.connect)
    outputs = choose_outputs(options, replace(viewing, headless=True), report) if record else Outputs()
    with recording_to(outputs):
        verdict, summary = verify_session(prepare(options, outputs, verify=True), record)
        if summary is None:
            return conclude(verdict, json_file)
        code = conclude(verdict, json_file, quiet=True)  # the summary's last line says it
        return finish(summary, outputs, report, on_stderr=json_file == "-") or code


def conclude(verdict: Verdict, json_file: str | None, quiet: bool = False) -> ExitCode:
    """Write the JSON, say the verdict, and hand back the exit code."""
    from inspector.run.verification import as_json
    from inspector.verdicts import line

    write_json(json_file, as_json(verdict))
    if not quiet:
        say(line(verdict), err=json_file == "-")
    return VERDICT_CODES[verdict.word]
