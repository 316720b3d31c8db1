"""``calib-inspect fleet``, ``fleet-report``, ``fleet-view`` and ``fleet-simulate``: many drives."""

from __future__ import annotations

import secrets
import shlex
import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING

import click

from calibnet.runtime.text import number_of
from calibnet.runtime.threads import cores
from calibnet.runtime.writing import OutputError
from inspector.cli.errors import ExitCode
from inspector.cli.options import DETAIL, FRAMES, SIZE
from inspector.cli.output import overwrite_option, say

if TYPE_CHECKING:
    from inspector.cli.fleet_drive import Task
    from inspector.fleet.engine import Engine, Outcome
    from inspector.fleet.table import Row
    from inspector.record.contents import Detail

LOOKING = 8
"""Threads that check which drives are done; they mostly wait for file systems."""
EVERY_S = 30.0
"""Seconds between updates of the table while the fleet runs, so that at most a tenth of the time goes there."""
MOST_NEWS = 10
"""Largest number of moved mounts named at the end; the page lists all."""
STOPPING = "Stopping once the running drives are done; press Ctrl-C again to abandon them."


@click.command()
@click.argument("sources", nargs=-1, required=True, metavar="DRIVES.csv | FOLDER...")
@click.option(
    "--output", "out", required=True, metavar="DIR|URL", help="Folder of all results; give the same folder to continue."
)
@click.option(
    "--workers",
    type=click.IntRange(0, 1024),
    metavar="N",
    help="Worker processes on this machine; 0 runs the drives in this process, without Dask.  [default: half of the "
    "cores]",
)
@click.option("--scheduler", metavar="tcp://HOST:PORT", help="Use this running Dask cluster.")
@click.option(
    "--memory",
    type=SIZE,
    metavar="SIZE",
    help="Memory of a worker, for instance 4GB.  [default: its share of the machine]",
)
@click.option("--detail", type=DETAIL, default="overview", show_default=True, help="How much of each frame to record.")
@click.option("--frames", type=FRAMES, help="Frames of every drive whose row gives none, as for `verify`.")
@click.option(
    "--options",
    default="",
    metavar="TEXT",
    help="Options of `verify` for every drive, for instance '--seed 1'.",
)
@click.option("--force", is_flag=True, help="Repeat finished drives.")
@overwrite_option
def fleet(
    sources: tuple[str, ...],
    out: str,
    workers: int | None,
    scheduler: str | None,
    memory: int | None,
    detail: Detail,
    frames: str | None,
    options: str,
    force: bool,
) -> int:
    """Calibrate many drives, and verify the calibration that each came with.

    DRIVES.csv has one row per drive: path, and optionally car, drive, date, dataset, sequence, camera, frames and
    options. A FOLDER is a drive of its own, with images/, clouds/ and calibration.yaml.

    Each drive gets a folder with its report, recording and verdict, and a row in fleet.parquet. Repeating the command
    runs only the drives that are missing or have changed. Exits with 0 if every drive has a row, whatever its verdict.
    """
    from calibnet.runtime.claim import Claim
    from calibnet.runtime.writing import Kind
    from inspector.cli.fleet_drive import Task, prepare_worker
    from inspector.fleet.drives import find_drives
    from inspector.fleet.engine import Engine
    from inspector.fleet.extra import require_extra
    from inspector.fleet.places import Store, is_url
    from inspector.fleet.table import TABLE

    if workers is not None and scheduler is not None:
        raise click.UsageError("Give --workers or --scheduler, not both.")
    common = f"--frames {shlex.quote(frames)} {options}" if frames else options
    drives = find_drives(sources, common)
    if any(map(is_url, (out, *(drive.path for drive in drives)))):
        require_extra("fsspec")
    store = Store(out if is_url(out) else str(Path(out).absolute()))
    run = secrets.token_hex(8)
    tasks = [Task(drive, store, str(detail), force, run) for drive in drives]
    store.check()
    engine = Engine(max(1, cores() // 2) if workers is None else workers, scheduler, memory or "auto", prepare_worker)
    claim = None if store.local is None else Claim(store.local / TABLE, Kind.PARQUET)
    try:
        return run_fleet(tasks, engine)
    finally:
        if claim is not None:
            claim.release()


def run_fleet(tasks: Sequence[Task], engine: Engine) -> int:
    """Run the drives that are not done, and keep the table of all; returns the exit code."""
    from calibnet.runtime.interruption import StopRequest
    from inspector.cli.fleet_console import fleet_progress
    from inspector.cli.fleet_drive import do_drive
    from inspector.fleet.engine import EngineError, run_all
    from inspector.fleet.ledger import word_counts
    from inspector.fleet.table import TABLE

    with ThreadPoolExecutor(LOOKING) as pool:  # errors in options are reported here, before the work
        looked = list(pool.map(needs_work_or_checked, tasks))
    rows = {task.drive.folder: row for task, row in zip(tasks, looked, strict=True) if row is not None}
    pieces = [task for task, row in zip(tasks, looked, strict=True) if row is None]
    if rows:
        say(f"{len(rows)} of {len(tasks)} drives are already done, with the same input, weights and options.", err=True)
    interrupted, gone, started = False, "", time.monotonic()
    written, took = started, 0.0
    store = tasks[0].store
    try:
        with StopRequest(STOPPING) as stop, fleet_progress(len(pieces)) as progress:
            for outcome in run_all(engine, do_drive, pieces, stop, lambda text: say(text, err=True)) if pieces else ():
                rows[outcome.work.drive.folder] = row = row_of_outcome(outcome)
                progress.advance(row)
                if time.monotonic() - written > max(EVERY_S, 10 * took):
                    begun = time.monotonic()
                    keep_table(tasks, rows)
                    written = time.monotonic()
                    took = written - begun
            interrupted = stop.requested and len(rows) < len(tasks)
    except KeyboardInterrupt:
        interrupted = True
    except EngineError as error:
        gone = str(error)
    in_order = keep_table(tasks, rows)
    seconds = time.monotonic() - started
    new = len(in_order) - (len(tasks) - len(pieces))
    now = f"{new} of them were checked or run now, in {seconds:.0f} s."
    say(f"{len(in_order)} of {len(tasks)} drives: {word_counts(in_order)}. {now}")
    for sentence in news(in_order):
        say(sentence)
    say(f"Table: {store.root}/{TABLE}")
    if interrupted or gone:
        again = shlex.join(["calib-inspect", *(word for word in sys.argv[1:] if word != "--force")])
        say(f"{gone or 'Interrupted.'} To continue with the others: {again}", err=True)
        return ExitCode.INTERRUPTED if interrupted else ExitCode.BAD_INPUT
    if store.local is not None:
        say(f"Make a page of it: calib-inspect fleet-report {shlex.quote(store.root)}")
    else:
        say(f"To make a page of it, copy {store.root} to this machine, then: calib-inspect fleet-report FOLDER")
    return ExitCode.OK


def news(rows: Sequence[Row]) -> Iterator[str]:
    """What the owner of a fleet wants to know first: findings across a car's drives, and whose mount moved."""
    from inspector.fleet.history import histories
    from inspector.fleet.ledger import joint_verdicts

    if together := joint_verdicts(rows):
        yield together
    moved = [car for car in histories(rows) if car.moves]
    yield from (f"{car.name}: {car.sentence}" for car in moved[:MOST_NEWS])
    if len(moved) > MOST_NEWS:
        yield f"{number_of(len(moved) - MOST_NEWS, 'more mount')} moved."


def needs_work_or_checked(task: Task) -> Row | None:
    """The row of a drive that is done; None for one that still has to run, whose options have been checked."""
    from inspector.cli.fleet_drive import needs_work, read_options

    row = needs_work(task)
    if row is None:
        read_options(task)
    return row


def row_of_outcome(outcome: Outcome[Task, Row]) -> Row:
    """The row of a drive that a worker has finished or failed."""
    from inspector.cli.fleet_drive import DriveFailed, note_failure
    from inspector.fleet.ledger import failed_row

    if outcome.done is not None:
        return outcome.done
    task, error = outcome.work, outcome.error
    if isinstance(error, DriveFailed):
        return note_failure(task, error)
    if type(error).__name__ == "KilledWorker":
        sentence = (
            "Two workers died while processing it; if they ran out of memory, set --memory or use fewer --workers."
        )
        return failed_row(task.drive, sentence)
    return failed_row(task.drive, f"The engine failed on it ({type(error).__name__}: {error}).")


def keep_table(tasks: Sequence[Task], rows: dict[str, Row]) -> list[Row]:
    """Write the rows so far, in the order of the list and each judged against its car's others, and return them."""
    from inspector.fleet.history import judged_by_cars
    from inspector.fleet.table import TABLE, table_bytes, write_table

    in_order = judged_by_cars([rows[task.drive.folder] for task in tasks if task.drive.folder in rows])
    store = tasks[0].store
    try:
        if store.local is not None:
            write_table(in_order, store.local / TABLE)
        else:
            store.write(TABLE, table_bytes(in_order))
    except OSError as error:
        raise OutputError(f"{store.root}/{TABLE} cannot be written ({error.strerror}); free some space.") from None
    return in_order
