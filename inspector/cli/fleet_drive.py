"""One drive of a fleet: verified in this process as `calib-inspect verify` does, with a folder of results and a row."""

from __future__ import annotations

import os
import re
import time
import traceback
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Lock
from typing import Any, NamedTuple

import click
from click.core import ParameterSource

from calibnet.errors import CalibnetError, CalibrationError, ConfigError, DatasetError
from calibnet.runtime.reading import protecting_inputs
from calibnet.runtime.text import one_line
from calibnet.runtime.writing import keeping_others
from inspector.cli.errors import environment_sentence
from inspector.cli.run_options import verify_options
from inspector.cli.subcommands import Opening, over_sequences
from inspector.fleet.drives import Drive
from inspector.fleet.ledger import ENTRY, Entry, Key, read_entry, write_entry
from inspector.fleet.places import Store, content, items_of, on_this_machine, seen
from inspector.fleet.table import FAILED, Row, of_verdict, row_major, row_of
from inspector.report.files import METRICS, PAGE, RECORDING

DECIDED = ("save", "serve", "bind", "connect", "report", "json_file", "overwrite")
"""Options of `verify` that the fleet decides itself."""
VERDICT, LOG = "verdict.json", "log.txt"
"""Files of a drive beside those of its report."""

_one_at_a_time = Lock()
"""Output and the list of files read belong to the whole process, so one drive runs at a time."""


class DriveFailed(Exception):  # noqa: N818 - it says what happened to the drive
    """A drive could not be done.

    Attributes:
        sentence: the reason.
        lasting: whether the input is to blame, so that another try on the same input would fail too.
    """

    def __init__(self, sentence: str, lasting: bool = False) -> None:
        super().__init__(sentence, lasting)
        self.sentence, self.lasting = sentence, lasting


@dataclass(frozen=True)
class Task:
    """Task of a worker.

    Attributes:
        drive: the drive to verify.
        store: the fleet's folder.
        detail: how much of each frame to record.
        force: whether to repeat a finished drive.
        run: identifier of the command's run, which tells its own results from earlier ones.
    """

    drive: Drive
    store: Store
    detail: str = "overview"
    force: bool = False
    run: str = ""

    def arguments(self, path: str | None = None) -> tuple[str, ...]:
        """Arguments of `calib-inspect verify` but for its outputs; with a path, of data that lies there."""
        command, *rest = self.drive.arguments(path)
        return (command, "--detail", self.detail, *rest)


class Asked(NamedTuple):
    """What a drive's row asks of `verify`, as the command reads it.

    Attributes:
        opening: opens its frames.
        options: of `inspector.cli.verify.verify_sequence`.
    """

    opening: Opening
    options: dict[str, Any]


def read_options(task: Task, path: str | None = None) -> Asked:
    """Read the options of a drive.

    Args:
        task: the drive.
        path: where its data lies, if that is not its own path.

    Raises:
        ConfigError: they are not valid; the sentence names the drive's row.
    """
    name, *arguments = task.arguments(path)
    command = _COMMANDS.commands[name]
    try:
        context = command.make_context(name, arguments)
        asked: Asked = command.invoke(context)
    except click.ClickException as error:
        raise ConfigError(f"{task.drive.origin}: {one_line(error.format_message())}") from None
    except (click.exceptions.Exit, click.Abort):
        raise ConfigError(f"{task.drive.origin}: --help is not an option of a drive; leave it out.") from None
    for decided in DECIDED:
        if context.get_parameter_source(decided) is ParameterSource.COMMANDLINE:
            option = next(one.opts[0] for one in command.params if one.name == decided)
            raise ConfigError(f"{task.drive.origin}: {option} is set by the fleet; leave it out.")
    return asked


_COMMANDS = click.Group("verify")
"""The subcommands of `verify`, which hand back what they are asked instead of doing it."""
over_sequences(_COMMANDS, lambda opening, **options: Asked(opening, options), lambda _: verify_options(), "Verify")


def key_of(task: Task) -> Key:
    """What a drive's result depends on, as far as file names, sizes and times tell.

    Raises:
        ConfigError: its options are not valid.
        DatasetError: its files cannot be listed.
    """
    options = read_options(task).options
    weights = weights_digest(options["preset"], options["weights"])
    return Key(task.arguments(), weights, seen(items_of(task.drive)))


def weights_digest(preset: str, folder: Path | None) -> str:
    """Identifies a set of weights and the version of the program that uses it.

    Raises:
        WeightsError: there are no such weights.
    """
    from calibnet import __version__
    from calibnet.weights.fingerprint import digest_of_set
    from calibnet.weights.manifest import PACKAGE

    return f"{__version__} {digest_of_set(preset, folder or PACKAGE)}"


def prepare_worker(threads: int = 0) -> None:
    """Let this process load weights once and, if a number is given, compute with that many threads."""
    from calibnet.cascade.loading import keep_weights
    from calibnet.runtime.threads import limit_threads

    keep_weights()
    if threads:
        limit_threads(threads)


def do_drive(task: Task) -> Row:
    """Verify a drive's calibration, save recording, report and JSON, and note in the ledger that it is done.

    Raises:
        DriveFailed: it cannot be verified.
    """
    from inspector.record.stream import release_closed

    with _one_at_a_time:
        started = time.monotonic()
        try:
            key = key_of(task)
            with on_this_machine(task.drive) as path:
                key = replace(key, content=content(path, task.drive))
                entry = read_entry(task.store, task.drive)
                wanted = entry is not None and (not task.force or entry.run == task.run)
                if entry is not None and wanted and entry.key.is_same(key):  # only times of files differ
                    write_entry(task.store, task.drive, replace(entry, key=key))
                    return entry.row
                row = _verified(task, path, started)
        except (CalibnetError, OSError) as error:
            raise _failed(error) from None
        finally:
            release_closed()
        write_entry(task.store, task.drive, Entry(key, row, task.run))
        return row


def _verified(task: Task, path: Path, started: float) -> Row:
    """Verify a drive, with all output in its folder, and make its row."""
    from inspector.cli.verify import verify_sequence

    drive = task.drive
    opening, options = read_options(task, str(path))
    with task.store.workplace(drive.folder) as folder:
        _clear(folder)
        try:
            with _logged(folder / LOG):
                results = {"json_file": str(folder / VERDICT), "report": folder}
                found = verify_sequence(opening, labels=drive.labels, **{**options, **results})
        except Exception as error:
            failed = _failed(error)
            failed = DriveFailed(_within_drive(failed.sentence, path), failed.lasting)
            with suppress(OSError, CalibnetError):  # the disk may be full: why it failed stands in the table as well
                _record_sentence(drive, folder, FAILED, "", failed.sentence)
            raise failed from None
        if found.summary is not None and found.summary.interrupted:
            raise KeyboardInterrupt
        columns = of_verdict(found.verdict) | {"given_camera_from_lidar": row_major(found.given)}
        columns["reason"] = _within_drive(columns["reason"], path)
        if not (folder / RECORDING).exists():
            _record_sentence(drive, folder, columns["verdict"], columns["cause"], columns["reason"])
        files = {"json": VERDICT, "report": PAGE, "recording": RECORDING}
        there = {name: f"{drive.folder}/{file}" for name, file in files.items() if (folder / file).exists()}
    return row_of(drive, **columns, **there, seconds=time.monotonic() - started)


def _within_drive(sentence: str, path: Path) -> str:
    """A sentence with paths relative to the drive's, which its row has; that of a temporary copy means nothing."""
    alone = rf"{re.escape(str(path))}(?=\.?(?:[\s,;:)'\"]|$))"
    return re.sub(alone, lambda _: path.name, sentence.replace(f"{path}{os.sep}", ""))


@contextmanager
def _logged(file: Path) -> Iterator[None]:
    """A context that sends all output to a file and, like a command, keeps track of the files it reads and writes."""
    log = file.open("w", encoding="utf-8", errors="backslashreplace")
    with log, redirect_stdout(log), redirect_stderr(log), protecting_inputs(), keeping_others():
        try:
            yield
        except Exception:
            traceback.print_exc(file=log)
            raise


def _clear(folder: Path) -> None:
    """Remove what an earlier run left: a drive that fails must not show another's report."""
    pictures = folder / "pictures"
    for path in (
        *(folder / name for name in (ENTRY, VERDICT, PAGE, RECORDING, METRICS)),
        *pictures.glob("*.jpg"),
    ):
        path.unlink(missing_ok=True)


def _record_sentence(drive: Drive, folder: Path, word: str, cause: str, sentence: str) -> None:
    from inspector.record.recording import RunDescription
    from inspector.record.sentence import record_sentence

    options = {"sequence": drive.name, "rig": "", **drive.labels}
    record_sentence(folder / RECORDING, RunDescription(drive.name, options), word, cause, sentence)


def _failed(error: BaseException) -> DriveFailed:
    """The failure of a drive, for an error that `verify` raised."""
    if isinstance(error, DriveFailed):
        return error
    if isinstance(error, CalibnetError):
        return DriveFailed(one_line(error), isinstance(error, DatasetError | CalibrationError))
    if isinstance(error, click.ClickException):
        return DriveFailed(one_line(error.format_message()))
    if isinstance(error, MemoryError):
        return DriveFailed("There is not enough memory for this drive; free some, or use fewer workers.")
    sentence = environment_sentence(error) if isinstance(error, OSError | ImportError) else None
    fault = f"Internal error in calib-inspect ({one_line(f'{type(error).__name__}: {error}', 300)}); see {LOG}."
    return DriveFailed(sentence or fault)


def needs_work(task: Task) -> Row | None:
    """The row of a drive that is done and has not changed; None for one that a worker has to look at."""
    if task.force:
        return None
    entry = read_entry(task.store, task.drive)
    if entry is None:
        return None
    try:
        return entry.row if entry.key.is_same(key_of(task)) else None
    except DatasetError:
        return None


def note_failure(task: Task, error: DriveFailed) -> Row:
    """The row of a drive that failed; if its input is to blame, the ledger notes not to try it again unchanged."""
    drive = task.drive
    recording = f"{drive.folder}/{RECORDING}"
    row = row_of(drive, verdict=FAILED, reason=error.sentence, recording=recording if task.store.has(recording) else "")
    if error.lasting:
        with suppress(CalibnetError, OSError):
            write_entry(task.store, drive, Entry(key_of(task), row))
    return row
