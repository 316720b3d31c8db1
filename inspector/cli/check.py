"""``calib-inspect check``: fail a build when a recorded calibration is not good enough."""

from __future__ import annotations

from pathlib import Path

import click

from calibnet.runtime.whole_file import write_whole
from inspector.cli.errors import ExitCode
from inspector.cli.recordings import OUTPUT_FILE, RECORDING, open_run

LIMIT = click.FloatRange(min=0.0)


@click.command()
@click.argument("recording", type=RECORDING, metavar="RUN.rrd")
@click.option("--max-rotation", type=LIMIT, metavar="DEG", help="Largest rotation error allowed, in degrees.")
@click.option("--max-translation", type=LIMIT, metavar="CM", help="Largest translation error allowed, in centimetres.")
@click.option(
    "--statistic",
    type=click.Choice(["median", "p95"]),
    default="median",
    show_default=True,
    help="Over the frames: which of their errors must keep the bounds.",
)
@click.option("--junit", "junit_file", type=OUTPUT_FILE, metavar="FILE", help="Also as JUnit XML.")
def check(
    recording: Path,
    max_rotation: float | None,
    max_translation: float | None,
    statistic: str,
    junit_file: Path | None,
) -> int:
    """Hold the errors of a recorded run against bounds; exits with 1 when one is exceeded.

    Give one bound or both. Errors are those of the corrected extrinsics against the reference.
    """
    if max_rotation is None and max_translation is None:
        raise click.UsageError("Give --max-rotation, --max-translation or both: without a bound nothing is checked.")
    from inspector.check import Bound, check_run, junit, summary

    limits = {"rotation": max_rotation, "translation": max_translation}
    bounds = [Bound(kind, limit, statistic) for kind, limit in limits.items() if limit is not None]
    run = open_run(recording)
    verdicts = check_run(run, bounds)
    if junit_file is not None:
        write_whole(junit_file, junit(run, verdicts))
    click.echo(summary(run, verdicts))
    return ExitCode.OK if all(verdict.passed for verdict in verdicts) else ExitCode.CHECK_FAILED
