"""``calib-inspect verify seq|raw|folder|bag|...``: whether the calibration that you have is good."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from calibnet.errors import CalibnetError
from inspector.cli.errors import VERDICT_CODES, ExitCode
from inspector.cli.output import prepare_json, say, write_json
from inspector.cli.preparing import prepare
from inspector.cli.run import checked_options, choose_outputs, finish, recording_to
from inspector.cli.run_options import verify_options
from inspector.cli.subcommands import Opening, disturbed, over_sequences

if TYPE_CHECKING:
    from calibnet.datasets import Sequence
    from inspector.cli.viewing import Viewing
    from inspector.run.options import RunOptions
    from inspector.run.verify import Verified


@click.group()
def verify() -> None:
    """Judge whether an existing calibration is good.

    Starts from the calibration as it is (or disturbed by --miscalibrate or --range, to try this command), solves all
    frames as one drive if there are several, and compares the result with the calibration. The tolerance is 0.3° and 8
    cm for a drive, or 0.5° and 15 cm if the result is less certain; for a single frame, 1° and 25 cm, or 1.5° and 40
    cm.

    Prints one sentence, and exits with 0 for accepted, 1 for rejected, 4 for cannot tell. Input that can be read but
    does not fit together gets a verdict as well. Nothing is recorded or shown without --save, --report, --serve or
    --connect, and nothing is ever exported.
    """


def verify_sequence(
    opening: Opening, *, json_file: str | None, viewing: Viewing, report: Path | None, **asked: Any
) -> Verified:
    """Judge the calibration of a sequence, say the verdict, and write whatever was asked for.

    Args:
        opening: opens the sequence.
        json_file: file for the verdict as JSON.
        viewing: where the recording is shown and saved, if anywhere.
        report: folder of the report to make.
        **asked: fields of `RunOptions`.
    """
    from calibnet.judging.verify import named_cause, unfit
    from inspector.record.outputs import Outputs
    from inspector.run.verify import UNKNOWN, Verified, verify_session

    prepare_json(json_file)
    try:
        sequence = opening()
    except CalibnetError as error:
        if not (causes := named_cause(error)):
            raise
        return report_verdict(Verified(unfit(UNKNOWN, str(error), causes), UNKNOWN), json_file)
    prepare_json(json_file)  # again, now that the input files are known
    options = options_to_verify(sequence, asked)
    record = bool(viewing.save or report or viewing.serve or viewing.connect)
    outputs = choose_outputs(options, viewing, report) if record else Outputs()
    with recording_to(outputs):
        found = report_verdict(verify_session(prepare(options, outputs, verify=True), record), json_file)
        if found.summary is not None:
            finish(found.summary, outputs, report, on_stderr=json_file == "-")
    return found


def options_to_verify(sequence: Sequence, asked: Mapping[str, Any]) -> RunOptions:
    """The options of a run that judges one calibration, by the drive where there are several frames."""
    options = checked_options(sequence, {**asked, "as_is": not disturbed(asked)})
    several = len(options.positions) > 1
    if several and options.drive is False:
        raise click.UsageError(
            f"The frames of {sequence.name} come from several mounts, and verify judges one calibration; "
            "choose one frame, for instance with --frames 0."
        )
    return replace(options, drive=several)


def report_verdict(found: Verified, json_file: str | None) -> Verified:
    """Write the verdict as JSON and, unless the last line of a summary will, say it."""
    from inspector.run.verify import as_json
    from inspector.verdicts import verdict_line

    write_json(json_file, as_json(found.verdict))
    if found.summary is None:
        say(verdict_line(found.verdict), err=json_file == "-")
    return found


def _command(opening: Opening, **asked: Any) -> ExitCode:
    """What the command does, and ends with."""
    found = verify_sequence(opening, **asked)
    interrupted = found.summary is not None and found.summary.interrupted
    return ExitCode.INTERRUPTED if interrupted else VERDICT_CODES[found.verdict.word]


over_sequences(verify, _command, lambda _: verify_options(), "Verify")
