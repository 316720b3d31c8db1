"""``calib-inspect verify seq|raw|folder|bag|...``: whether the calibration that you have is good."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from calibnet.errors import CalibnetError
from inspector.cli.errors import VERDICT_CODES, ExitCode
from inspector.cli.output import prepare_json, say, write_json
from inspector.cli.preparing import prepare
from inspector.cli.run import checked, choose_outputs, finish, recording_to
from inspector.cli.run_options import verify_options
from inspector.cli.sequences import Opening, disturbed, over_sequences

if TYPE_CHECKING:
    from calibnet.verdict import Verdict
    from inspector.cli.viewing import Viewing
    from inspector.run.options import RunOptions


@click.group()
def verify() -> None:
    """Judge whether an existing calibration is good.

    It starts from the calibration as it is (or disturbed by --miscalibrate or --range, to try this command), solves all
    frames as one drive if there are several, and compares the result with the calibration. The tolerance of a drive is
    0.3° and 8 cm, or 0.5° and 15 cm if the result is less certain; of a single frame 1° and 25 cm, or 1.5° and 40 cm.

    Prints one sentence, and exits with 0 for accepted, 1 for rejected, 4 for cannot tell. Input that can be read but
    does not fit gets a verdict as well. Nothing is recorded or shown without --save, --report, --serve or --connect,
    and nothing is ever exported.
    """


def verify_sequence(
    opening: Opening, *, json_file: str | None, viewing: Viewing, report: Path | None, **asked: Any
) -> int:
    """Judge the calibration of a sequence; returns the exit code.

    Args:
        opening: opens the sequence.
        json_file: where the verdict goes as JSON.
        viewing: where the recording is shown and kept, if anywhere.
        report: folder of the report to make.
        **asked: fields of `RunOptions`.
    """
    prepare_json(json_file)
    from calibnet.judging.verify import named_cause, unfit
    from inspector.run.verify import UNKNOWN

    try:
        sequence = opening()
    except CalibnetError as error:
        causes = named_cause(error)
        if not causes:
            raise
        return conclude(unfit(UNKNOWN, str(error), causes), json_file)
    prepare_json(json_file)  # once more, since it is known now what is read
    options = checked(sequence, {**asked, "as_is": not disturbed(asked)})
    several = len(options.positions) > 1
    if several and options.drive is False:
        raise click.UsageError(
            f"The frames of {sequence.name} are of several mounts, and verify judges one calibration; "
            "choose one frame, for instance with --frames 0."
        )
    options = replace(options, drive=several)
    return verify_run(options, json_file, viewing, report)


def verify_run(options: RunOptions, json_file: str | None, viewing: Viewing, report: Path | None) -> int:
    """Run what the verdict needs, record it where that was asked for, and say the verdict."""
    from inspector.record.outputs import Outputs
    from inspector.run.verify import verify_session

    record = bool(viewing.save or report or viewing.serve or viewing.connect)
    outputs = choose_outputs(options, viewing, report) if record else Outputs()
    with recording_to(outputs):
        verdict, summary = verify_session(prepare(options, outputs, verify=True), record)
        if summary is None:
            return conclude(verdict, json_file)
        code = conclude(verdict, json_file, quiet=True)  # the summary's last line says it
        return finish(summary, outputs, report, on_stderr=json_file == "-") or code


def conclude(verdict: Verdict, json_file: str | None, quiet: bool = False) -> ExitCode:
    """Write the JSON, say the verdict, and hand back the exit code."""
    from inspector.run.verify import as_json
    from inspector.verdicts import line

    write_json(json_file, as_json(verdict))
    if not quiet:
        say(line(verdict), err=json_file == "-")
    return VERDICT_CODES[verdict.word]


over_sequences(verify, verify_sequence, lambda _: verify_options(), "Verify")
