"""``calib-inspect watch seq|raw|folder|bag|...``: whether the mount moved during a drive."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

import click

from inspector.cli.errors import ExitCode
from inspector.cli.output import prepare_json, say, write_json
from inspector.cli.preparing import prepare
from inspector.cli.run import checked_options, choose_outputs, recording_to
from inspector.cli.run_options import watch_options
from inspector.cli.sources import SOURCES
from inspector.cli.subcommands import Opening, disturbed, over_sequences
from inspector.cli.viewing import saved_lines

if TYPE_CHECKING:
    from calibnet.cascade.cascade import Cascade
    from calibnet.watch import Watched
    from inspector.cli.viewing import Viewing
    from inspector.run.session import Session


@click.group()
def watch() -> None:
    """Detect whether the mount moved during a drive.

    Starts from the calibration as it is (or disturbed by --miscalibrate or --range, to try this command), estimates the
    extrinsic from every frame, and detects steps and slow drift. Needs at least 16 frames, in the order in which they
    were taken.

    Prints one sentence per change, with its frame, size and confidence, and exits with 0 for no change, 1 for changed,
    4 for cannot tell. With --save, --serve or --connect a recording shows the estimate over the drive, with its band.
    """


def watch_sequence(opening: Opening, *, json_file: str | None, viewing: Viewing, **asked: Any) -> int:
    """Watch a sequence; returns the exit code.

    Args:
        opening: opens the sequence.
        json_file: file for the result as JSON.
        viewing: where the recording is shown and saved, if anywhere.
        **asked: fields of `RunOptions`.
    """
    prepare_json(json_file)
    from inspector.mount_changes import CANNOT_TELL, CHANGED, as_json, result_word, sentences
    from inspector.record.outputs import Outputs

    options = checked_options(
        opening(), {**asked, "frames": asked["frames"] or ":", "as_is": not disturbed(asked), "drive": True}
    )
    prepare_json(json_file)  # again, now that the input files are known
    record = bool(viewing.save or viewing.serve or viewing.connect)
    outputs = choose_outputs(options, viewing, None) if record else Outputs()
    with recording_to(outputs):
        session = prepare(options, outputs, verify=True)
        watched = watch_session(session)
        lines = list(sentences(watched))
        if record:
            from inspector.record.watch import record_watch

            title = f"{options.title}, watched"
            recording_id = session.description.recording_id + "-watch"
            remark = record_watch(outputs.open(), title, recording_id, watched.watch, lines)
            if remark:
                say(remark, err=True)
            outputs.complete()
        write_json(json_file, as_json(watched))
        for line in [*saved_lines(outputs), *lines]:
            say(line, err=json_file == "-")
        if outputs.page is not None:
            say(f"Serving at {outputs.page} until Ctrl-C.", err=json_file == "-")
            outputs.wait_while_serving()
    codes = {CHANGED: ExitCode.CHECK_FAILED, CANNOT_TELL: ExitCode.CANNOT_TELL}
    return codes.get(result_word(watched), ExitCode.OK)


def watch_session(session: Session) -> Watched:
    """Watch the drive of a session, from the extrinsic that it starts from.

    Raises:
        DatasetError: not a single frame can be read.
    """
    from calibnet.drive.watching import watch_drive
    from calibnet.runtime.interruption import StopRequest
    from inspector.run.precomputed_drive import first_readable
    from inspector.run.progress import drive_observer, frame_progress
    from inspector.run.session import STOPPING

    initial = session.start.initial(first_readable(session.frames))
    with StopRequest(STOPPING) as stop, frame_progress(session.console) as progress:
        return watch_drive(cast("Cascade", session.cascade), session.frames, initial, drive_observer(progress, stop))


DRIVES = [source for source in SOURCES if source.one_mount]
over_sequences(watch, watch_sequence, lambda _: watch_options(), "Watch", DRIVES)
