"""A calibration run from its options to its end, shared by all commands that calibrate."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from inspector.cli.errors import ExitCode
from inspector.cli.output import say
from inspector.cli.preparing import prepare
from inspector.cli.viewing import next_lines, saved_lines
from inspector.run.options import OptionsError, RunOptions

if TYPE_CHECKING:
    from calibnet.datasets import Sequence
    from inspector.cli.viewing import Viewing
    from inspector.record.outputs import Outputs
    from inspector.run.summary import Summary


def calibrate(sequence: Sequence, *, viewing: Viewing, report: Path | None, **asked: Any) -> int:
    """Run the cascade on a sequence; returns the exit code.

    Args:
        sequence: what to calibrate.
        viewing: where the recording is shown and saved.
        report: folder of the report to make.
        **asked: fields of `RunOptions`.
    """
    options = checked_options(sequence, asked)
    outputs = choose_outputs(options, viewing, report)
    with recording_to(outputs):
        return finish(prepare(options, outputs).run(), outputs, report)


def checked_options(sequence: Sequence, asked: Mapping[str, Any]) -> RunOptions:
    """Make the options of a run, checked not to contradict each other and to select some frames."""
    try:
        options = RunOptions(sequence=sequence, **asked)
    except OptionsError as error:
        raise click.UsageError(str(error)) from None
    options.positions  # noqa: B018
    return options


@contextmanager
def recording_to(outputs: Outputs) -> Iterator[None]:
    """Close the outputs at the end, whatever happens."""
    try:
        yield
    finally:
        outputs.close()


def choose_outputs(options: RunOptions, viewing: Viewing, report: Path | None) -> Outputs:
    """Choose and check where the recording goes; with a report, it is saved in any case."""
    if report is not None:
        from inspector.report.files import RECORDING
        from inspector.report.write import check_folder

        check_folder(report)
        viewing = replace(viewing, save=viewing.save or report / RECORDING)
    outputs = viewing.outputs(options.sequence.name)
    outputs.check()
    return outputs


def finish(summary: Summary, outputs: Outputs, report: Path | None, on_stderr: bool = False) -> int:
    """Print the result and where it was saved, make the report, and with --serve, serve until Ctrl-C.

    The last line is the verdict. With ``on_stderr``, stdout is left to something else.
    """
    tell = partial(say, err=on_stderr)
    for line in summary.lines():
        tell(line)
    if outputs.file is not None and summary.frames:
        for line in [
            *size_lines(outputs.file, summary.frames),
            *saved_lines(outputs, summary.frames),
            *next_lines(outputs.file, summary.exportable),
        ]:
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
        say("Interrupted; only the frames above were recorded.", err=True)
        return ExitCode.INTERRUPTED
    if outputs.page is not None:
        outputs.wait_while_serving()
    return ExitCode.OK


def size_lines(file: Path, frames: int) -> list[str]:
    """A line on the size of a frame's parts; none for a recording without an index."""
    from inspector.read.sizes import sizes_by_group

    parts = [f"{group} {size / frames / 1e3:.0f}" for group, size in sizes_by_group(file).items()]
    return [f"Kilobytes per frame: {', '.join(parts)}."] if parts else []
