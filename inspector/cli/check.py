"""``calib-inspect check``: fail a build when a recorded calibration is not good enough."""

from __future__ import annotations

from pathlib import Path

import click

from calibnet.runtime.writing import Kind
from inspector.cli.errors import VERDICT_CODES, ExitCode
from inspector.cli.options import NumberRange
from inspector.cli.output import (
    JSON_FILE,
    OUTPUT_FILE,
    overwrite_option,
    prepare,
    prepare_json,
    say,
    write,
    write_json,
)
from inspector.cli.recordings import RECORDING, open_run

LIMIT = NumberRange(min=0.0)


@click.command()
@click.argument("recording", type=RECORDING, metavar="RUN.rrd")
@click.option("--max-rotation", type=LIMIT, metavar="DEG", help="Largest rotation error allowed, in degrees.")
@click.option("--max-translation", type=LIMIT, metavar="CM", help="Largest translation error allowed, in centimetres.")
@click.option(
    "--max-sigma-rotation",
    type=LIMIT,
    metavar="DEG",
    help="Largest stated uncertainty of the rotation (1σ), in degrees.",
)
@click.option("--max-sigma-translation", type=LIMIT, metavar="CM", help="The same for the translation, in centimetres.")
@click.option(
    "--max-scatter-rotation",
    type=LIMIT,
    metavar="DEG",
    help="Largest rotation between a frame's result and the median of all frames, in degrees.",
)
@click.option(
    "--max-scatter-translation", type=LIMIT, metavar="CM", help="The same for the translation, in centimetres."
)
@click.option("--max-unused", type=LIMIT, metavar="PERCENT", help="Largest share of rejected and skipped frames.")
@click.option("--max-fit", type=LIMIT, metavar="PX", help="Largest match error that the last stage expects, in pixels.")
@click.option(
    "--statistic",
    type=click.Choice(["median", "p95", "max", "drive"]),
    default="median",
    show_default=True,
    help="Error that the limits apply to: a statistic over the frames, or the error of the drive's extrinsic.",
)
@click.option("--json", "json_file", type=JSON_FILE, metavar="FILE|-", help="The verdict as JSON; - for stdout.")
@click.option("--junit", "junit_file", type=OUTPUT_FILE, metavar="FILE", help="Also as JUnit XML.")
@overwrite_option
def check(
    recording: Path,
    statistic: str,
    json_file: str | None,
    junit_file: Path | None,
    **largest: float | None,
) -> int:
    """Check the verdict of a recorded run and, if given, limits.

    Exits with 1 if the verdict is rejected or a limit is exceeded, and with 4 if the verdict is cannot tell. The
    verdict is that of the drive or, without one, of the frames: rejected if at least half of them are rejected,
    accepted if more than half are accepted. Errors compare the frames' corrected extrinsics with the reference. These
    limits need no reference: --max-sigma-..., --max-scatter-..., --max-unused and --max-fit.
    """
    from inspector.check import KINDS, Limit, check_run, junit, summary
    from inspector.verdicts import verdict_line

    given = {option.removeprefix("max_"): value for option, value in largest.items() if value is not None}
    limits = [Limit(kind, given[kind], statistic) for kind in KINDS if kind in given]
    prepare_json(json_file)
    prepare(junit_file, Kind.JUNIT)
    run = open_run(recording)
    outcomes = check_run(run, limits)
    verdict = run.verdict
    if junit_file is not None:
        write(junit_file, junit(run, outcomes), Kind.JUNIT)
    write_json(json_file, verdict.as_dict() | {"limits": [outcome.as_dict() for outcome in outcomes]})
    if outcomes:
        say(summary(run, outcomes), err=json_file == "-")
    say(verdict_line(verdict), err=json_file == "-")
    if not all(outcome.passed for outcome in outcomes):
        return ExitCode.CHECK_FAILED
    return VERDICT_CODES[verdict.word]
