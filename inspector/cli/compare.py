"""``calib-inspect compare``: several runs on the same frames, side by side."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import click

from calibnet.geometry import degrees_and_cm
from inspector.cli.errors import ExitCode
from inspector.cli.output import say
from inspector.cli.recordings import RECORDING, open_run
from inspector.cli.run import recording_to
from inspector.cli.viewing import saved_lines, viewing_options

if TYPE_CHECKING:
    from inspector.cli.viewing import Viewing
    from inspector.compare.comparison import Comparison
    from inspector.record.outputs import Outputs


@click.command()
@click.argument("recordings", type=RECORDING, nargs=-1, required=True, metavar="A.rrd B.rrd [C.rrd ...]")
@click.option("--names", metavar="A,B", help="Names of the runs, comma-separated.  [default: those of the files]")
@click.option("--common-frames", is_flag=True, help="Compare the frames that all runs have.")
@viewing_options
def compare(
    recordings: tuple[Path, ...],
    names: str | None,
    common_frames: bool,
    viewing: Viewing,
) -> int:
    """Put recorded runs of one sequence side by side: other weights, miscalibration or preset.

    Shows each run's result for the whole drive, all error curves in one plot, and a table of the single frames'
    medians, 95th percentiles and success rates with the differences from the first run.
    """
    if len(recordings) < 2:
        raise click.UsageError("Give two recordings or more.")
    called = [name.strip() for name in names.split(",")] if names else [path.stem for path in recordings]
    if len(called) != len(recordings):
        raise click.UsageError(f"--names has {len(called)} names for {len(recordings)} recordings.")

    from inspector.compare.comparison import Comparison, check_names
    from inspector.compare.recording import record_comparison

    check_names(called)
    outputs = viewing.outputs(f"compare-{'-'.join(called)}")
    comparison = Comparison.of([open_run(path) for path in recordings], called, common_frames)
    with recording_to(outputs):
        outputs.check()
        remark = record_comparison(comparison, outputs.open())
        if remark:
            say(remark, err=True)
        outputs.complete()
        return finish(comparison, outputs)


def comparison_lines(comparison: Comparison) -> Iterator[str]:
    """One sentence per run: its error or, without a reference, its distance from the first run."""
    for run in comparison.runs:
        drive, metrics, off = run.run.drive_error, run.corrected, "off"
        if metrics is None and run is not comparison.first:
            metrics, off = run.distance(comparison.first), f"from {comparison.first.name}"
        parts = []
        if drive is not None:
            parts.append(f"{degrees_and_cm(drive.rotation_deg, drive.translation_cm)} off as one drive")
        if metrics is not None:
            median = f"{degrees_and_cm(metrics.rotation_deg.median, metrics.translation_cm.median)} {off}"
            parts.append(f"{median}, median over {len(run.frames)} frames")
        if parts:
            yield f"{run.name}: {'; '.join(parts)}."


def finish(comparison: Comparison, outputs: Outputs) -> int:
    """Print the errors of the runs and where the comparison was saved; with --serve, serve it until Ctrl-C."""
    for line in comparison_lines(comparison):
        say(line)
    if outputs.file is not None:
        for line in saved_lines(outputs, len(comparison.indices)):
            say(line)
    if outputs.page is not None:
        say(f"Serving at {outputs.page} until Ctrl-C.")
        outputs.wait_while_serving()
    return ExitCode.OK
